//! Fitting Gaussians to the photos of one scene: the parts of the loop, independent of any paper.
//!
//! | file | idea |
//! |---|---|
//! | [`method`] | the trait [`Method`](method::Method): the contribution of a paper to a step |
//! | [`intake`], [`saved`], [`told`] | what a method takes from a data set, what a file holds of it, what people see of it |
//! | [`session`] | one step, from the choice of its photos to density control, for every driver |
//! | [`trainer`] | the state and its step: forward, backward, update, density control |
//! | [`training`] | a module with its optimiser and counters, for this loop and any other |
//! | [`photos`], [`sampler`] | views as tensors, and which of them a step uses |
//! | [`coarse`] | their width over the steps |
//! | [`facts`], [`preflight`] | values fixed by the data set, and whether it suits a configuration |
//! | [`region`] | the box whose pixels count |
//! | [`extrapolation`] | what a method knows of the future of its scene |
//! | [`initialise`] | the Gaussians of step 0 |
//! | [`correction`] | exposure and white balance of the photos |
//! | [`camera_paths`], [`shutter`] | learned poses of training photos, and the images that they form |
//! | [`align`] | poses of held-out photos |
//! | [`losses`], [`schedule`], [`random`] | loss, decay of rates, random draws |
//! | [`budget`] | a budget of time as a number of steps |
//! | [`times`] | a scene at many times |
//! | [`timetable`] | what a training does at which step, for charts |
//! | [`parameters`] | Gaussians as a table |
//! | [`density`] | adding, relocating and removing Gaussians |
//! | [`snapshot`] | the state as named tensors, for checkpoints |
//! | [`bench`](mod@bench) | steps without a data set, for `gsburn bench` |

pub mod align;
pub mod bench;
pub mod budget;
pub mod camera_paths;
pub mod coarse;
pub mod correction;
pub mod density;
pub mod depth;
pub mod extrapolation;
pub mod facts;
pub mod figure;
pub mod initialise;
pub mod intake;
pub mod losses;
pub mod method;
pub mod outlines;
pub mod parameters;
pub mod photos;
pub mod preflight;
pub mod random;
pub mod region;
pub mod room;
pub mod sampler;
pub mod saved;
pub mod schedule;
pub mod session;
pub mod shutter;
pub mod snapshot;
pub mod times;
pub mod timetable;
pub mod told;
pub mod trainer;
pub mod training;
