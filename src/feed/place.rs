//! Where a run's socket is, and whose it is.
//!
//! It lies in the run's directory, which only its owner may enter. A directory whose name is too long for a socket's, or
//! whose file system has none, gets a link there to a socket below `/tmp`.

use std::fs::{self, DirBuilder, Permissions};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt, symlink};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use rustix::process::geteuid;

use crate::run_directory::SOCKET;

/// Opens the socket of the run that holds the directory's lock: what lies there is a dead run's, and goes.
pub(super) fn listen(directory: &Path) -> io::Result<UnixListener> {
    let path = directory.join(SOCKET);
    bind(&path).or_else(|_| {
        let elsewhere = short_place(directory)?;
        let listener = bind(&elsewhere)?;
        remove(&path)?;
        symlink(&elsewhere, &path)?;
        Ok(listener)
    })
}

/// Connects to the run of a directory.
pub(super) fn connect(directory: &Path) -> io::Result<UnixStream> {
    let path = directory.join(SOCKET);
    UnixStream::connect(fs::read_link(&path).unwrap_or(path))
}

/// Removes the socket of a run that ends.
pub(super) fn close(directory: &Path) {
    let path = directory.join(SOCKET);
    if let Ok(elsewhere) = fs::read_link(&path) {
        let _ = fs::remove_file(elsewhere);
    }
    let _ = fs::remove_file(path);
}

/// Whether the process at the other end is this user's.
#[cfg(target_os = "linux")]
pub(super) fn is_ours(stream: &UnixStream) -> bool {
    rustix::net::sockopt::socket_peercred(stream).is_ok_and(|peer| peer.uid == geteuid())
}

/// Elsewhere the directory's mode alone keeps others away.
#[cfg(not(target_os = "linux"))]
pub(super) fn is_ours(_stream: &UnixStream) -> bool {
    true
}

fn bind(path: &Path) -> io::Result<UnixListener> {
    remove(path)?;
    let listener = UnixListener::bind(path)?;
    fs::set_permissions(path, Permissions::from_mode(0o600))?;
    Ok(listener)
}

fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// A short path for the socket of a directory, in a place that is this user's alone.
fn short_place(directory: &Path) -> io::Result<PathBuf> {
    let user = geteuid();
    let place = PathBuf::from(format!("/tmp/moltop-{}", user.as_raw()));
    if let Err(error) = DirBuilder::new().mode(0o700).create(&place)
        && error.kind() != io::ErrorKind::AlreadyExists
    {
        return Err(error);
    }
    let found = fs::symlink_metadata(&place)?; // a link would lead elsewhere
    if !found.is_dir() || found.uid() != user.as_raw() || found.mode() & 0o077 != 0 {
        let words = format!("{} is not a directory of this user alone", place.display());
        return Err(io::Error::other(words));
    }
    let mut hasher = DefaultHasher::new();
    directory.hash(&mut hasher);
    Ok(place.join(format!("{:016x}", hasher.finish())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_gets_a_short_socket() {
        let place = tempfile::tempdir().expect("a temporary directory");
        for name in ["short".to_owned(), "long".repeat(40)] {
            let directory = place.path().join(name);
            fs::create_dir(&directory).expect("a directory");
            let listener = listen(&directory).expect("a socket");
            connect(&directory).expect("somebody listens");
            drop(listener);
            connect(&directory).expect_err("nobody listens");
            // What a dead run has left is no obstacle.
            let _listener = listen(&directory).expect("a socket");
            connect(&directory).expect("somebody listens");
            close(&directory);
            assert_eq!(fs::read_dir(&directory).expect("a directory").count(), 0);
        }
    }
}
