//! What an FMI function answers (FMI 2.0, clause 2.1.3).

/// `fmi2Status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum Status {
    /// All is well.
    Ok = 0,
    /// Something is not quite right, but the call was done.
    Warning = 1,
    /// The call was not done; the component is as it was before.
    Discard = 2,
    /// The call was wrong.
    Error = 3,
    /// The component can only be freed.
    Fatal = 4,
    /// The call continues in the background. This shell never returns it.
    Pending = 5,
}
