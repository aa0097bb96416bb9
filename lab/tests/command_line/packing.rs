//! What `vines pack` refuses.

use crate::fails;

#[test]
fn packing_without_libraries_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    fails(
        &["pack", "--out", path, "--libraries", path],
        2,
        "cargo build --release",
    );
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        0,
        "nothing is left behind"
    );
}

#[test]
fn packing_refuses_what_it_cannot_pack_before_it_writes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let pack = |option: &[&'static str]| [&["pack", "--out", out], option].concat();
    fails(&pack(&["--binary", "win64"]), 2, "PLATFORM=PATH");
    fails(&pack(&["--binary", "amiga=x.so"]), 2, "amiga");
    fails(&pack(&["--set", "plant.r=2"]), 2, "r (coefficient of restitution) = 2");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
