//! Observers of any training: folder, clock, progress, checkpoints, measurements. Nothing here can change a step's
//! result.
//!
//! | file | idea |
//! |---|---|
//! | [`watch`] | a run under way, as the loop of a pipeline sees it |
//! | [`folder`], [`lock`] | where a run's files are, what is in them, and who may write them |
//! | [`checkpoint`], [`fingerprint`] | saved states, and whether a run goes on with the views it began on |
//! | [`evaluate`], [`metrics`], [`retaken`] | held-out views rendered and measured; blurry photos formed again |
//! | [`scene`], [`exchange`] | finished scenes in and out, and those of other programs |
//! | [`outputs`], [`results`], [`listing`] | files that are never written over, and folders that appear whole |
//! | [`ending`], [`outcome`] | the last files of a run, each if the disk takes it; the contents of its report |
//! | [`presentation`], [`pixels`] | how a scene is shown; images as bytes |
//! | [`progress`], [`resources`], [`memory`], [`profile`], [`interrupt`] | what a user sees while it runs |

pub mod checkpoint;
pub mod ending;
pub mod evaluate;
pub mod exchange;
pub mod fingerprint;
pub mod folder;
pub mod interrupt;
pub mod listing;
pub mod lock;
pub mod measured;
pub mod memory;
pub mod metrics;
pub mod outcome;
pub mod outputs;
pub mod pixels;
pub mod presentation;
pub mod profile;
pub mod progress;
pub mod resources;
pub mod results;
pub mod retaken;
pub mod scene;
pub mod watch;
