//! Makes the meshes of the example scenes: `cargo run --release -p beamfarm-scene --example
//! make_meshes` writes scenes/meshes/*.ply. The same bytes come out on every machine.

mod meshes;

use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/meshes");
    std::fs::create_dir_all(&folder)?;
    let mut total = 0;
    for (name, mesh) in meshes::all() {
        let bytes = mesh.to_ply();
        println!("{name:<22} {:>8} bytes", bytes.len());
        total += bytes.len();
        std::fs::write(folder.join(name), bytes)?;
    }
    println!("{:<22} {total:>8} bytes", "in all");
    Ok(())
}
