//! [`Told`]: the part of a method that people see.

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_datasets::{Scene, View};
use gs_models::{DynamicScene, Shutter};

use super::figure::Figures;
use super::method::{Method, Step};
use super::timetable::Timetable;
use crate::config::FitConfig;

/// A part of a held-out view that is scored separately.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Region {
    /// Its name, such as "moving".
    pub name: &'static str,
    /// `[height, width]`: 255 inside.
    pub mask: Vec<u8>,
}

/// The name of the region in which something moves.
pub const MOVING: &str = "moving";

/// The image with which a held-out photo was compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compared {
    /// The sharp rendering.
    Sharp,
    /// The blurred image formed over the photo's exposure.
    FormedBlur,
}

/// A key of the configuration by which charts distinguish runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChartKey {
    /// Name in charts.
    pub name: &'static str,
    /// Key of the configuration.
    pub key: &'static str,
    /// Label for a name and value: `("none", "no blur model")`; with `("*", "")` every other value is its own label.
    pub words: &'static [(&'static str, &'static str)],
    /// The key has no meaning if another key has this value: `("blur.mode", "none")`.
    pub unless: Option<(&'static str, &'static str)>,
}

impl ChartKey {
    /// The chart label of the key with a value: `no blur model`, `N 7`, `cap 20k`.
    pub fn label(&self, value: &str) -> String {
        if let Some((_, words)) = self.words.iter().find(|(of, _)| *of == value) {
            return (*words).to_string();
        }
        if self.words.iter().any(|(of, _)| *of == "*") {
            return value.to_string();
        }
        match value.parse::<usize>() {
            Ok(number) if number >= 1000 && number.is_multiple_of(100) => {
                format!("{} {}k", self.name, number as f64 / 1000.0)
            }
            _ => format!("{} {value}", self.name),
        }
    }
}

/// The key that is part of every chart of runs.
pub const CAP: ChartKey = ChartKey { name: "cap", key: "density.cap", words: &[], unless: None };

/// The lines of a method before the first step.
#[derive(Debug, Default)]
pub struct Introduction {
    /// Lines.
    pub lines: Vec<String>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// The schedule of the training, for a chart; `None`: nothing changes on the way.
    pub schedule: Option<Timetable>,
}

/// The part of a method that people see.
pub trait Told: Method {
    /// The default time at which a scene is shown.
    fn middle(&self) -> f64 {
        0.0
    }

    /// Figures beside image quality, over `views`.
    fn figures(&self, _gaussians: &Gaussians, _scene: &Scene, _views: &[View], _at: &Step<Self>) -> Figures {
        Figures::default()
    }

    /// Lines for `gsburn info`: name and value.
    fn described(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Keys of the configuration by which charts distinguish runs.
    fn chart_keys() -> &'static [ChartKey] {
        &[CAP]
    }

    /// Lines, warnings and schedule, shown before the first step.
    fn introduction(&self, _scene: &Scene, _at: &Step<Self>) -> Introduction {
        Introduction::default()
    }

    /// The method's measurements of blurry photos, if it models blur.
    fn blur() -> Option<&'static dyn Blur<Self>>
    where
        Self: Sized,
    {
        None
    }
}

/// The measurements of a method for photos that are blurred by motion over their exposure.
pub trait Blur<M: Method>: Sync {
    /// The moving regions of each held-out view, inferred where the data set gives none.
    fn regions(&self, views: &[View]) -> Vec<Vec<Region>>;

    /// The blurred image with which a held-out photo is compared, `[H, W, 3]` from 0 to 1; `None`: the sharp rendering.
    fn formed(&self, method: &M, gaussians: &Gaussians, view: &View, at: &Step<M>) -> Option<Tensor<3>>;

    /// How the exposures of `scene` are formed; `None`: `config` models no blur.
    fn shutter(&self, scene: &dyn DynamicScene, config: &FitConfig<M::Config>) -> Option<Shutter>;

    /// Bytes that training needs beside those of 3D Gaussian Splatting, by purpose.
    fn memory(&self, scene: &Scene, config: &FitConfig<M::Config>) -> Vec<(&'static str, u64)>;
}

/// The moving part of a view, as given by the data set: by the truth, else by the given masks.
pub fn given_regions(view: &View) -> Vec<Region> {
    let moving = view.truth.moving.as_ref().or(view.priors.moving.as_ref());
    moving.map(|mask| Region { name: MOVING, mask: mask.clone() }).into_iter().collect()
}
