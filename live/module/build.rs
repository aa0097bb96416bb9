//! Turns lab/scene/paper.toml and lab/page/settings.json into constants, so that the module needs neither a TOML nor a JSON reader.

use std::{env, error::Error, fmt::Write, fs, path::Path};

const SCENE: &str = "../../lab/scene/paper.toml";
const SETTINGS: &str = "../../lab/page/settings.json";

fn main() -> Result<(), Box<dyn Error>> {
    for file in [SCENE, SETTINGS] {
        println!("cargo:rerun-if-changed={file}");
    }
    let scene: toml::Table = fs::read_to_string(SCENE)?.parse()?;
    let number = |section: &str, key: &str| -> Result<f64, Box<dyn Error>> {
        let value = scene.get(section).and_then(|section| section.get(key));
        let value = value.and_then(|value| value.as_float().or(value.as_integer().map(|whole| whole as f64)));
        value.ok_or_else(|| format!("{SCENE} has no number {section}.{key}").into())
    };
    let mut code = String::new();
    for (constant, section, keys) in [
        ("PLANT", "plant", ["M", "k", "c", "m", "b", "r"].as_slice()),
        ("START", "start", &["q1", "dq1", "q2", "dq2"]),
        ("EXCITATION", "excitation", &["G"]),
    ] {
        let values: Result<Vec<f64>, _> = keys.iter().map(|key| number(section, key)).collect();
        writeln!(code, "pub const {constant}: [f64; {}] = {:?};", keys.len(), values?)?;
    }
    let table: serde_json::Value = serde_json::from_str(&fs::read_to_string(SETTINGS)?)?;
    let settings = table["settings"]
        .as_array()
        .ok_or("settings.json has no list `settings`")?;
    writeln!(code, "pub const COUNT: usize = {};\npub mod index {{", settings.len())?;
    for (index, setting) in settings.iter().enumerate() {
        let key = setting["key"].as_str().ok_or("a setting has no key")?;
        writeln!(code, "pub const {}: usize = {index};", key.to_uppercase())?;
    }
    code.push_str("}\n");
    fs::write(Path::new(&env::var("OUT_DIR")?).join("generated.rs"), code)?;
    Ok(())
}
