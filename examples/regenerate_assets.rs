//! Writes the shipped scenes anew, to `assets/scenes/NAME/scene.glb` in the current folder.

use std::path::Path;

use krylux::error::{Error, Result};
use krylux::scene::builtin;

fn main() -> Result<()> {
    for model in builtin::shipped() {
        let folder = Path::new("assets/scenes").join(model.name);
        std::fs::create_dir_all(&folder).map_err(Error::writing(&folder))?;
        let path = folder.join("scene.glb");
        let bytes = model.to_glb();
        std::fs::write(&path, &bytes).map_err(Error::writing(&path))?;
        println!("{} ({} bytes)", path.display(), bytes.len());
    }
    Ok(())
}
