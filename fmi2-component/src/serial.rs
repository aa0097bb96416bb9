//! FMU states as bytes: a header that identifies foreign or damaged states, and the session.

use crate::archive::Archive;
use crate::component::Component;
use crate::model::Model;
use crate::refusal::Refusal;
use crate::session::{Select, Session};

/// Changes with the layout that the shell itself writes.
const MAGIC: [u8; 8] = *b"FMU2 st3";
/// Magic, checksum.
const HEADER: usize = 16;

/// The session as bytes.
pub(crate) fn serialise<C: Component>(session: &Session<C>) -> Result<Vec<u8>, Refusal> {
    let mut bytes = vec![0; HEADER];
    let mut archive = Archive::writer(&mut bytes);
    archive.whole(&mut identity::<C>())?;
    session.clone().archive(&mut archive)?;
    let checksum = fnv1a(&bytes[HEADER..]);
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..HEADER].copy_from_slice(&checksum.to_le_bytes());
    Ok(bytes)
}

/// The session that `bytes` hold; refuses anything that [`serialise`] of the same model has not written.
pub(crate) fn deserialise<C: Component>(bytes: &[u8], select: Select<C>) -> Result<Session<C>, Refusal> {
    let Some((header, body)) = bytes.split_at_checked(HEADER) else {
        return Err(Refusal::error(format!(
            "the serialised state has {} bytes; expected more than {HEADER}",
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
    let mut found = Identity::default();
    archive.whole(&mut found)?;
    let expected = identity::<C>();
    if found != expected {
        return Err(Refusal::error(format!(
            "the serialised state is of another model: its GUID and version are {} and {}, expected {} and {}",
            found.0, found.1, expected.0, expected.1
        )));
    }
    let mut session = Session::new(select)?;
    session.archive(&mut archive)?;
    archive.finish()?;
    Ok(session)
}

/// GUID and version of a model: together they fix what the bytes mean.
type Identity = (String, String);

fn identity<C: Component>() -> Identity {
    (C::Model::GUID.to_owned(), C::Model::VERSION.to_owned())
}

/// The 64-bit Fowler–Noll–Vo hash, variant 1a.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
