//! A program and all that it starts in turn: a job object.

use std::io::{Error, Result};
use std::mem::size_of_val;
use std::os::windows::io::{AsRawHandle, FromRawHandle, OwnedHandle};
use std::os::windows::process::CommandExt;
use std::process::{Child, Command};
use std::ptr::{from_ref, null};
use windows_sys::Win32::System::JobObjects::{
    AssignProcessToJobObject, CreateJobObjectW, JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE,
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION, JobObjectExtendedLimitInformation, SetInformationJobObject,
    TerminateJobObject,
};
use windows_sys::Win32::System::Threading::CREATE_NEW_PROCESS_GROUP;

/// The job. It ends with its handle, and so also if this program is killed.
#[derive(Debug)]
pub struct Group(OwnedHandle);

/// Starts a program in a group of its own, which Ctrl-C does not reach.
pub fn start(command: &mut Command) -> Result<(Child, Group)> {
    // SAFETY: null is allowed for both.
    let job = unsafe { CreateJobObjectW(null(), null()) };
    if job.is_null() {
        return Err(Error::last_os_error());
    }
    // SAFETY: the handle is valid, and has no other owner.
    let job = unsafe { OwnedHandle::from_raw_handle(job) };
    let mut limits = JOBOBJECT_EXTENDED_LIMIT_INFORMATION::default();
    limits.BasicLimitInformation.LimitFlags = JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE;
    let (at, size) = (from_ref(&limits).cast(), size_of_val(&limits) as u32);
    // SAFETY: the handle is valid, and so is the pointer for this size.
    if unsafe { SetInformationJobObject(job.as_raw_handle(), JobObjectExtendedLimitInformation, at, size) } == 0 {
        return Err(Error::last_os_error());
    }
    let mut child = command.creation_flags(CREATE_NEW_PROCESS_GROUP).spawn()?;
    // SAFETY: both handles are valid.
    if unsafe { AssignProcessToJobObject(job.as_raw_handle(), child.as_raw_handle()) } == 0 {
        let error = Error::last_os_error();
        child.kill()?;
        return Err(error);
    }
    Ok((child, Group(job)))
}

impl Group {
    /// Kills all programs of the group.
    pub fn kill(&self, _child: &Child) {
        // SAFETY: the handle is valid. The call fails only without the right to end the job, which its creator has.
        unsafe { TerminateJobObject(self.0.as_raw_handle(), 1) };
    }
}
