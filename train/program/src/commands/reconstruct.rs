//! `gsburn reconstruct`.

use std::process::ExitCode;

use anyhow::{Result, bail};

use crate::cli::ReconstructArgs;
use crate::commands::{device, print};
use crate::report::viewer;
use gs_pipelines::{Reconstruction, networks_of, shipped};
use gs_train::run::interrupt;
use gs_train::run::scene::{SceneFile, read_file};

/// Applies a trained network to a driving log. After Ctrl-C what is done is kept.
///
/// # Errors
/// One sentence saying what was wrong with the network, the log or the folder.
pub fn run(args: &ReconstructArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let checkpoint = match &args.model {
        None => shipped()?,
        Some(path) => match read_file(path)? {
            SceneFile::Checkpoint(checkpoint) => *checkpoint,
            SceneFile::Ply(_) => {
                bail!("{}: expected a run or a checkpoint of a network, found a PLY file", path.display())
            }
        },
    };
    let request = Reconstruction {
        log: &args.log,
        set: &args.set,
        out: &args.out,
        start: args.start,
        full: args.full,
        future: usize::from(args.future),
        times: &args.times,
        polish: args.polish as usize,
        shift: args.shift.0,
        rest_speed: args.rest_speed,
        edit: args.edit.as_deref(),
        page: viewer::page_of,
        device: &device,
    };
    interrupt::watch();
    for line in networks_of(&checkpoint)?.reconstruct(&checkpoint, &request)? {
        print(line);
    }
    Ok(if interrupt::asked() { ExitCode::from(interrupt::exit_code()) } else { ExitCode::SUCCESS })
}
