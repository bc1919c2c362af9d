fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let skip = args.iter().any(|a| a == "--skip");
    let args: Vec<_> = args.iter().filter(|a| *a != "--skip").collect();
    let options = beamfarm_scene::ImportOptions {
        skip_unsupported: skip,
        ..Default::default()
    };
    let path = std::path::Path::new(args[0]);
    let folder = args
        .get(1)
        .and_then(|o| std::path::Path::new(o).parent())
        .unwrap_or(std::path::Path::new(""));
    match beamfarm_scene::SceneFile::read_for(path, folder, &options) {
        Ok(file) => {
            if let Some(out) = args.get(1) {
                let _ = std::fs::write(out, file.text());
            }
            for n in &file.notes {
                eprintln!("note: {n}");
            }
            for n in &file.left_out {
                eprintln!("left out: {n}");
            }
            if let Err(e) = file.load() {
                println!("LOAD: {e}");
                std::process::exit(2);
            }
            println!("ok");
        }
        Err(e) => {
            println!("{e}");
            std::process::exit(1);
        }
    }
}
