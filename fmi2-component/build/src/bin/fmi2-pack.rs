//! Makes an FMU of a description and a library: `fmi2-pack modelDescription.xml LIBRARY FOLDER`.

use std::error::Error;
use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;

use zip::{ZipWriter, write::SimpleFileOptions};

/// Folder below `binaries` and suffix of a library for the platform that this runs on.
const PLATFORM: (&str, &str) = if cfg!(target_os = "macos") {
    ("darwin64", "dylib")
} else if cfg!(windows) {
    ("win64", "dll")
} else if cfg!(target_arch = "aarch64") {
    ("aarch64-linux", "so")
} else {
    ("linux64", "so")
};

fn pack(description: &str, library: &str, folder: &str) -> Result<(), Box<dyn Error>> {
    let xml = fmi2_component_build::describe(&fs::read_to_string(description)?)?;
    let (_, rest) = xml.split_once("modelIdentifier=\"").ok_or("no modelIdentifier")?;
    let identifier = rest.split('"').next().unwrap_or_default();
    let (platform, suffix) = PLATFORM;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in [
        ("modelDescription.xml".to_owned(), xml.clone().into_bytes()),
        (format!("binaries/{platform}/{identifier}.{suffix}"), fs::read(library)?),
    ] {
        zip.start_file(name, SimpleFileOptions::DEFAULT)?;
        zip.write_all(&content)?;
    }
    let target = Path::new(folder).join(format!("{identifier}.fmu"));
    fs::write(&target, zip.finish()?.into_inner())?;
    println!("{}", target.display());
    Ok(())
}

fn main() {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let done = match &arguments[..] {
        [description, library, folder] => pack(description, library, folder),
        _ => Err("usage: fmi2-pack modelDescription.xml LIBRARY FOLDER".into()),
    };
    if let Err(error) = done {
        eprintln!("error: {error}");
        std::process::exit(1);
    }
}
