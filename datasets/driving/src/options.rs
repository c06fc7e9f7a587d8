//! [`LogOptions`]: which cameras are read, and at which size.

/// The cameras that are read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum CameraUse {
    /// All of the log.
    #[default]
    All,
    /// The one that looks ahead: `front_camera`, `ring_front_center`, `FRONT`. The paper's tables use it alone.
    Front,
    /// The cameras of these names.
    Named(Vec<String>),
}

/// How a log is opened.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LogOptions {
    /// The cameras.
    pub cameras: CameraUse,
    /// Wider images are downscaled to this width, by area; `None` keeps them.
    pub max_width: Option<usize>,
}

/// Names of front cameras, by data set.
const FRONT: [&str; 3] = ["front_camera", "ring_front_center", "FRONT"];

impl CameraUse {
    /// Whether a camera is read.
    pub(crate) fn takes(&self, name: &str) -> bool {
        match self {
            Self::All => true,
            Self::Front => FRONT.contains(&name),
            Self::Named(names) => names.iter().any(|known| known == name),
        }
    }
}
