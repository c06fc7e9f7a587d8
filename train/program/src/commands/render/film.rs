//! A film of the images: MP4 by the program ffmpeg, or a GIF where there is none.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, bail};
use gs_base::atomic::PartialFile;

use crate::report::maps::write_gif;
use gs_train::run::outputs::MARK;

/// Whether `ffmpeg` answers.
pub(super) fn has_ffmpeg() -> bool {
    let quiet = || Stdio::null();
    let asked = Command::new("ffmpeg").arg("-version").stdin(quiet()).stdout(quiet()).stderr(quiet()).status();
    asked.is_ok_and(|status| status.success())
}

/// A film being made.
pub(super) struct Film {
    path: PathBuf,
    size: (usize, usize),
    kind: Kind,
}

enum Kind {
    /// Images go to the program as they come; it writes under a temporary name.
    Mp4 {
        ffmpeg: Child,
        partial: PartialFile,
    },
    Gif(Vec<Vec<u8>>),
}

impl Film {
    /// Begins a film; `path` ends in mp4 or gif.
    ///
    /// # Errors
    /// When the program cannot be started.
    pub fn begin(path: PathBuf, size: (usize, usize), rate: u32) -> Result<Self> {
        if path.extension().is_some_and(|ending| ending == "gif") {
            return Ok(Self { path, size, kind: Kind::Gif(Vec::new()) });
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        }
        let partial = PartialFile::beside(&path);
        // Sides of the usual colour coding are even: a last row or column is repeated where they are not.
        let even = "pad=ceil(iw/2)*2:ceil(ih/2)*2";
        let ffmpeg = Command::new("ffmpeg")
            .args(["-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &format!("{}x{}", size.0, size.1), "-r", &rate.to_string(), "-i", "-"])
            // The temporary name has no ending that says the format.
            .args(["-vf", even, "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"])
            .arg(partial.temporary())
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .with_context(|| format!("{}: cannot start ffmpeg", path.display()))?;
        Ok(Self { path, size, kind: Kind::Mp4 { ffmpeg, partial } })
    }

    /// Adds an image, `[H * W * 3]`.
    ///
    /// # Errors
    /// When it has another size than the film, or the program does not take it.
    pub fn add(&mut self, size: (usize, usize), pixels: &[u8]) -> Result<()> {
        if size != self.size {
            bail!(
                "{}: expected images of {} x {} pixels in one film, found one of {} x {}; choose a --size",
                self.path.display(),
                self.size.0,
                self.size.1,
                size.0,
                size.1
            );
        }
        match &mut self.kind {
            Kind::Mp4 { ffmpeg, .. } => {
                let input = ffmpeg.stdin.as_mut().expect("piped");
                input.write_all(pixels).with_context(|| format!("{}: ffmpeg ended early", self.path.display()))
            }
            Kind::Gif(images) => {
                images.push(pixels.to_vec());
                Ok(())
            }
        }
    }

    /// Ends the film and gives it its name.
    ///
    /// # Errors
    /// When the program fails, or the file cannot be written; then no part of it is left.
    pub fn finish(self) -> Result<PathBuf> {
        let path = self.path;
        match self.kind {
            Kind::Gif(images) => write_gif(&path, self.size.0, self.size.1, &images)?,
            Kind::Mp4 { mut ffmpeg, partial } => {
                drop(ffmpeg.stdin.take());
                let done = ffmpeg.wait().with_context(|| format!("{}: ffmpeg", path.display()))?;
                let named = if done.success() { name_it(partial) } else { Err(anyhow::anyhow!("ffmpeg failed")) };
                named.with_context(|| format!("{}: cannot make the film", path.display()))?;
            }
        }
        Ok(path)
    }
}

/// Appends a box with our mark, which players skip, and renames the file.
fn name_it(partial: PartialFile) -> Result<()> {
    let mut file = std::fs::OpenOptions::new().append(true).open(partial.temporary())?;
    let length = 8 + MARK.len() as u32;
    file.write_all(&[&length.to_be_bytes(), &b"free"[..], MARK.as_bytes()].concat())?;
    Ok(partial.finish()?)
}
