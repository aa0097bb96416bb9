//! Tests of `instance`.

use std::io::Write;

use super::*;

/// An FMU of these files, (name inside, content), and the reason why it is refused.
fn refused(files: &[(&str, &str)]) -> LoadError {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fmu");
    let mut zip = zip::ZipWriter::new(File::create(&path).unwrap());
    for (name, content) in files {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(content.as_bytes()).unwrap();
    }
    zip.finish().unwrap();
    match Fmu::load(&path, "rig") {
        Err(FmuError::Load { source, .. }) => source,
        _ => panic!("it was loaded"),
    }
}

/// A description of that FMI version with this element.
fn description(version: &str, element: &str) -> String {
    format!(
        "<fmiModelDescription xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" fmiVersion=\"{version}\" \
         modelName=\"a\">{element}<ModelVariables><Float64 name=\"x\"/></ModelVariables></fmiModelDescription>"
    )
}

#[test]
fn an_fmu_that_the_bench_cannot_use_is_refused_with_the_reason() {
    let xml = "modelDescription.xml";
    let model = "<CoSimulation modelIdentifier=\"a\"/>";
    let library = format!("binaries/{}/a{}", library::folders()[0], std::env::consts::DLL_SUFFIX);
    assert!(matches!(refused(&[]), LoadError::File(_)));
    assert!(matches!(refused(&[(xml, "<a/>")]), LoadError::Description(_)));
    let version = refused(&[(xml, &description("3.0", model))]);
    assert!(
        matches!(&version, LoadError::Version(version) if version == "3.0"),
        "{version}"
    );
    let exchange = refused(&[(xml, &description("2.0", "<ModelExchange modelIdentifier=\"a\"/>"))]);
    assert!(matches!(exchange, LoadError::NoCoSimulation));
    let missing = refused(&[(xml, &description("2.0", model))]);
    assert!(
        matches!(&missing, LoadError::NoLibrary(paths) if paths.contains(&library)),
        "{missing}"
    );
    let text = refused(&[(xml, &description("2.0", model)), (&library, "text")]);
    assert!(matches!(text, LoadError::Library(_)), "{text}");
}

#[test]
fn the_address_of_a_folder_has_no_spaces() {
    assert_eq!(
        uri(Path::new("/tmp/a b/ü%/resources")),
        "file:///tmp/a%20b/%C3%BC%25/resources"
    );
    assert_eq!(uri(Path::new("C:\\a_b\\c-d")), "file:///C:/a_b/c-d");
}

#[test]
fn a_file_that_is_not_an_archive_is_refused() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
    let error = Fmu::load(path, "rig").err().unwrap();
    let FmuError::Load { source, .. } = &error else {
        panic!("{error}");
    };
    assert!(matches!(source, LoadError::Archive(_)), "{error}");
    let message = error.to_string();
    assert!(
        message.contains("Cargo.toml") && message.contains("zip archive"),
        "{message}"
    );
}
