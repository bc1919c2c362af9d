"""One render by one renderer in a process of its own: `python job.py JOB.json`, which writes pictures and a result."""

import importlib
import json
import os
import pathlib
import sys


class Job:
    def __init__(self, values):
        self.scene, self.check, self.size = values["scene"], values["check"], values["size"]
        self.seconds, self.seed, self.threads = values["seconds"], values["seed"], values["threads"]
        self.denoise, self.program = values["denoise"], values["program"]
        self.mode = values.get("mode")  # of those that a renderer has, for trying them
        self.folder = pathlib.Path(values["folder"])
        self.results = {}

    def image(self, seconds):
        return self.folder / f"{seconds:g}.exr"

    def done(self, asked, seconds, note):
        self.results[f"{asked:g}"] = {"seconds": seconds, "note": note}


if __name__ == "__main__":
    file = pathlib.Path(sys.argv[1])
    values = json.loads(file.read_text())
    job = Job(values)
    if hasattr(os, "sched_setaffinity"):
        # Whatever a renderer does with its threads, it gets as many cores as the others.
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: job.threads])
    module = importlib.import_module("with_" + values["renderer"])
    if values["version"]:
        result = module.version(job.program)
    else:
        module.render(job)
        result = job.results
    file.with_name("result.json").write_text(json.dumps(result))
    # LuxCore's threads may crash an interpreter that ends as usual.
    sys.stdout.flush()
    os._exit(0)
