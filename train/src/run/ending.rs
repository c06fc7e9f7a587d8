//! The end of a run: on a disk that is full, each of its last files is written if it fits.

use anyhow::{Result, anyhow};

use crate::sentence::one_sentence;

/// The last files of a run: which are written, and the first failure.
#[derive(Debug, Default)]
pub struct LastFiles {
    written: Vec<&'static str>,
    /// Why the first that failed did.
    lost: Option<anyhow::Error>,
}

impl LastFiles {
    /// Notes whether a file was written.
    pub fn tried<T>(&mut self, name: &'static str, written: Result<T>) {
        match written {
            Ok(_) => self.written.push(name),
            Err(error) => drop(self.lost.get_or_insert(error)),
        }
    }

    /// # Errors
    /// The first failure, and what was written all the same.
    pub fn done(self) -> Result<()> {
        let Some(error) = self.lost else { return Ok(()) };
        let written = match self.written.split_last() {
            None => "nothing else fits either".to_string(),
            Some((only, [])) => format!("{only} is written"),
            Some((last, others)) => format!("{} and {last} are written", others.join(", ")),
        };
        Err(anyhow!("{}; {written}", one_sentence(&error)))
    }
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::*;

    #[test]
    fn the_first_failure_is_told_with_what_is_written() {
        let mut all = LastFiles::default();
        all.tried("the checkpoint", Ok(()));
        all.done().expect("all is written");
        let mut some = LastFiles::default();
        some.tried("the checkpoint", Err::<(), _>(anyhow!("step-3: no space")));
        some.tried("scene.ply", Ok(()));
        some.tried("eval.json", Ok(()));
        some.tried("report.html", Err::<(), _>(anyhow!("report.html: no space")));
        assert_eq!(some.done().expect_err("lost").to_string(), "step-3: no space; scene.ply and eval.json are written");
    }
}
