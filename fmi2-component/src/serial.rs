//! FMU states as bytes: a header that tells a foreign or damaged blob, and the session.

use crate::archive::Archive;
use crate::component::Component;
use crate::model::Model;
use crate::refusal::Refusal;
use crate::session::Session;

/// Changes with the layout that the shell itself writes.
const MAGIC: [u8; 8] = *b"FMU2 st1";
/// Magic, checksum.
const HEADER: usize = 16;

/// The session as bytes.
pub(crate) fn serialise<C: Component>(session: &Session<C>) -> Result<Vec<u8>, Refusal> {
    let mut bytes = vec![0; HEADER];
    let mut archive = Archive::writer(&mut bytes);
    archive.whole(&mut C::Model::GUID.to_owned())?;
    session.clone().archive(&mut archive)?;
    let checksum = fnv1a(&bytes[HEADER..]);
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..HEADER].copy_from_slice(&checksum.to_le_bytes());
    Ok(bytes)
}

/// The session that `bytes` hold; refuses anything that [`serialise`] of the same model has not written.
pub(crate) fn deserialise<C: Component>(bytes: &[u8]) -> Result<Session<C>, Refusal> {
    let Some((header, body)) = bytes.split_at_checked(HEADER) else {
        return Err(Refusal::error(format!(
            "the serialised state has {} bytes; expected are more than {HEADER}",
            bytes.len()
        )));
    };
    if header[..8] != MAGIC {
        return Err(Refusal::error(
            "the bytes are not a serialised state of this component, or one of another version",
        ));
    }
    if header[8..] != fnv1a(body).to_le_bytes() {
        return Err(Refusal::error(
            "the serialised state is truncated or damaged: its checksum differs",
        ));
    }
    let mut archive = Archive::reader(body);
    let mut guid = String::new();
    archive.whole(&mut guid)?;
    if guid != C::Model::GUID {
        return Err(Refusal::error(format!(
            "the serialised state is of another model: its GUID is {guid}, expected is {}",
            C::Model::GUID
        )));
    }
    let mut session = Session::new()?;
    session.archive(&mut archive)?;
    archive.finish()?;
    Ok(session)
}

/// The 64-bit Fowler–Noll–Vo hash, variant 1a.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
