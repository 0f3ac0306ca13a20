//! What a long experiment keeps beside its results while it goes on: the same command takes it up where it was interrupted.
//!
//! It is a checkpoint file, so it is whole or refused, and belongs to one scene with one set of options. With the results it is
//! no longer needed, and goes.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::checkpoint;
use crate::error::{Error, Result};
use crate::output::Target;

/// Where it is kept, and what it belongs to.
#[derive(Clone, Debug)]
pub struct Kept {
    path: Option<PathBuf>,
    key: u64,
}

impl Kept {
    /// In the directory of the results, if there is one: what an experiment of this name has measured of something that `what`
    /// tells from anything else.
    pub fn new(directory: Option<&Path>, name: &str, what: &str) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        Self {
            path: directory.map(|directory| directory.join(format!("{name}.unfinished"))),
            key: checkpoint::hash(format!("{name} {version}\n{what}").into_bytes()),
        }
    }

    /// What an interrupted run has left; `None` if nothing did.
    ///
    /// # Errors
    /// [`Error::Usage`] if it belongs to something else or is damaged, unless it may be overwritten: then it is passed over.
    pub fn load<T: DeserializeOwned>(&self, overwrite: bool) -> Result<Option<T>> {
        let Some(path) = self.path.as_ref().filter(|path| path.exists()) else {
            return Ok(None);
        };
        let why = match checkpoint::load(path) {
            Ok((value, key)) if key == self.key => return Ok(Some(value)),
            Ok(_) => format!(
                "{}: is of another scene, other options or another version",
                path.display()
            ),
            Err(why) => why,
        };
        if overwrite {
            return Ok(None);
        }
        Err(Error::Usage(format!("{why}: --force begins anew")))
    }

    /// Keeps it.
    ///
    /// # Errors
    /// [`Error::File`] with what the system answered.
    pub fn store(&self, value: &impl Serialize) -> Result<()> {
        let Some(path) = &self.path else {
            return Ok(());
        };
        Target::replacing(path.clone()).write(|writer| checkpoint::write(value, self.key, writer))
    }

    /// The file, if there is to be one.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// What is said of an experiment that a signal has ended.
    pub fn interrupted(&self) -> &'static str {
        match self.path {
            Some(_) => {
                "Interrupted: this is what had been measured; the same command goes on from here."
            }
            None => "Interrupted: this is what had been measured.",
        }
    }

    /// Everything is in the results now.
    pub fn remove(&self) {
        if let Some(path) = &self.path {
            let _ = fs::remove_file(path); // left behind, it spares the next run what is known already
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_comes_back_for_the_same_scene_only() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let kept = |what| Kept::new(Some(directory.path()), "trade", what);
        assert_eq!(kept("a").load::<Vec<f64>>(false).expect("nothing"), None);
        kept("a").store(&vec![1.0, 0.1]).expect("written");
        let found = kept("a").load::<Vec<f64>>(false).expect("whole");
        assert_eq!(found, Some(vec![1.0, 0.1]));
        let refused = kept("b")
            .load::<Vec<f64>>(false)
            .expect_err("another scene");
        assert!(refused.to_string().contains("--force begins anew"));
        assert_eq!(kept("b").load::<Vec<f64>>(true).expect("passed over"), None);
        kept("a").remove();
        assert_eq!(kept("a").load::<Vec<f64>>(false).expect("gone"), None);
    }

    #[test]
    fn without_a_directory_nothing_is_kept() {
        let kept = Kept::new(None, "trade", "a");
        kept.store(&1.0).expect("nothing to do");
        assert_eq!(kept.load::<f64>(false).expect("nothing"), None);
    }
}
