//! Arguments of `view` and `watch`, the commands that show a scene in a browser.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;

use crate::cli::DeviceArgs;

const VIEW_EXAMPLES: &str = "\
Examples:
  gsburn view runs/my-photos                       writes runs/my-photos/view.html
  gsburn view scene.ply --out scene.html           a scene of any program; without a run there are no cameras, only an orbit

The page is one file that needs no other file and no network: open it by double click, send it, put it on any server. It draws as
gsburn render does. Drag turns the scene; the line of keys is in the page. docs/viewing.md says what it agrees with, and its limits.";

/// Arguments of `view`.
#[derive(Debug, Args)]
#[command(after_help = VIEW_EXAMPLES)]
pub struct ViewArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply, .spz, .glb, .sog, .splat, .ksplat)
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: PathBuf,

    /// The page to write [default: view.html in the run folder; beside a file, its name with .html]
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub out: Option<PathBuf>,

    /// The data set with cameras and photos [default: that of the run]
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub data: Option<PathBuf>,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

const WATCH_EXAMPLES: &str = "\
Examples:
  gsburn watch runs/my-photos                      prints the address of a page with the newest checkpoint and its curves
  gsburn watch runs/my-photos --port 8080          on another machine, after: ssh -L 8080:127.0.0.1:8080 that-machine

It is a process of its own: the training does not know of it, and is as fast and as exact as without. Checkpoints come every
checkpoint.every steps. The page is served to this machine alone. Ctrl-C ends it; the training goes on.";

/// Arguments of `watch`.
#[derive(Debug, Args)]
#[command(after_help = WATCH_EXAMPLES)]
pub struct WatchArgs {
    /// The run folder; it may still be in training, or finished
    #[arg(value_hint = ValueHint::DirPath)]
    pub run: PathBuf,

    /// Port on 127.0.0.1; 0: any that is free
    #[arg(long, default_value_t = 0, value_name = "PORT")]
    pub port: u16,

    /// The data set with cameras and photos [default: that of the run]
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub data: Option<PathBuf>,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}
