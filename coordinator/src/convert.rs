//! `beamfarm convert`: Mitsuba scenes and glTF files to native scenes.

use crate::failure::Failure;
use crate::import::{ImportArgs, announce};
use crate::output::make_folder;
use beamfarm_image::{atomic, bundle};
use beamfarm_scene::{SceneFile, is_gltf, is_mitsuba};
use beamfarm_worker::say;
use clap::Args;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

pub const EXAMPLES: &str = "\
Examples:
  beamfarm convert scene.xml scene.toml
  beamfarm convert scene.xml scene.toml -D spp=256 -D resx=1920
                                                  with values for its $spp and $resx
  beamfarm convert scene.xml scene.toml --skip-unsupported
                                                  without what is not supported, which is listed
  beamfarm convert model.glb model.toml           a scene that names the glTF file

Reads scenes of Mitsuba 3 and of older versions of its format. Names come from ids. Meshes, images and volumes stay
where they are, and the new file names them relative to its own folder, which is made. An existing file is replaced.
What Mitsuba decides and this program does not (the integrator, the sampler) is noted on stderr. Whatever is not
supported is an error with plugin, parameter, file and line, all of them at once; --skip-unsupported leaves it out.

A glTF file becomes a scene that names the file, with its first camera, or one that looks at all of it,
and with light where it has none.

`render`, `serve`, `replay` and `explain` read either directly and give the same pixels.";

#[derive(Args)]
pub struct ConvertArgs {
    /// Mitsuba scene (.xml) or glTF file (.glb, .gltf)
    scene: PathBuf,

    /// Where to write the native scene (.toml)
    output: PathBuf,

    #[command(flatten)]
    import: ImportArgs,
}

pub fn main(args: ConvertArgs) -> Result<(), Failure> {
    if !is_mitsuba(&args.scene) && !is_gltf(&args.scene) {
        let message = format!(
            "{}: expected a Mitsuba scene, whose name ends in .xml, or a glTF file, whose name ends in .glb or .gltf",
            args.scene.display()
        );
        return Err(Failure::usage(message));
    }
    if args.output.extension() != Some(OsStr::new("toml")) {
        let message = format!("{}: expected a name that ends in .toml", args.output.display());
        return Err(Failure::usage(message));
    }
    let folder = args.output.parent().unwrap_or(Path::new(""));
    let options = args.import.options(&args.scene)?;
    // Before the scene is read: relative paths from a missing folder do not resolve.
    if !folder.as_os_str().is_empty() {
        make_folder(folder)?;
    }
    let file = SceneFile::read_for(&args.scene, folder, &options)?;
    // Refuse to write a file that cannot be rendered.
    let description = file.load()?;
    for name in &file.made {
        let bytes = file.bundle.files.get(&bundle::key(name)).map_or(&[][..], Vec::as_slice);
        atomic::write_file(&folder.join(name), bytes)?;
    }
    atomic::write_file(&args.output, file.text())?;
    announce(&file.notes, &file.left_out);
    let outside = file.reach.note();
    announce(
        outside
            .map(|note| format!("{}: {note}", args.scene.display()))
            .as_slice(),
        &[],
    );
    if is_gltf(&args.scene) {
        announce(&description.notes, &[]);
    }
    say!("wrote {}", args.output.display());
    Ok(())
}
