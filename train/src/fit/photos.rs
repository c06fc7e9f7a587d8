//! Photos: views as tensors on the device.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::Camera;
use gs_datasets::{Decoded, View};
use rayon::prelude::*;

use super::correction::ColorChange;
use super::region::Region;
use super::shutter::{Instant, ShutterPath};

/// A photo on the device, with the method's data.
#[derive(Debug, Clone)]
pub struct Photo<X> {
    /// The photo's camera.
    pub camera: Camera,
    /// `[H, W, 3]`, 0 to 1, encoded as the file is; sRGB of a file in linear light.
    pub image: Tensor<3>,
    /// `[H, W, 1]`: 1 = compare, 0 = ignore; `None` if every pixel counts.
    pub mask: Option<Tensor<3>>,
    /// Middle of the exposure, in the data set's unit; 0 if the view has no time.
    pub time: f64,
    /// Width of a pixel, pixels of the scene's photo: 1, or more of a photo at a reduced width.
    pub pixel: f64,
    /// Share of the rays of all photos that meet the region of interest; 1 without one.
    pub share: f64,
    /// Index of its view among those of the scene's split.
    pub index: usize,
    /// The change of a rendering's colours to the photo's; `None`: none.
    pub color: Option<ColorChange>,
    /// The camera's way through the photo's exposure; `None`: it is where `camera` says all the time.
    pub path: Option<ShutterPath>,
    /// The method's data.
    pub extra: X,
}

impl<X> Photo<X> {
    /// Colours `[H, W, 3]` of the scene as the photo shows them.
    pub fn taken(&self, seen: Tensor<3>) -> Tensor<3> {
        match &self.color {
            Some(change) => change.of(seen),
            None => seen,
        }
    }

    /// The camera in the middle of the exposure.
    pub fn middle(&self) -> Camera {
        self.path.as_ref().map_or_else(|| self.camera.clone(), ShutterPath::middle)
    }

    /// Length of the photo's frame, from the first row's exposure to the last row's, in exposures.
    pub fn frame(&self) -> f64 {
        self.path.as_ref().and_then(|path| path.share.as_ref()).map_or(1.0, |(_, share)| 1.0 / share)
    }

    /// The instants of the photo's exposure, at least `least` if its camera moves.
    pub fn instants(&self, least: usize) -> Vec<Instant> {
        match &self.path {
            Some(path) => path.instants(least),
            None => vec![Instant::still(self.camera.clone())],
        }
    }
}

/// A method's device data of a photo: masks, depth and the like.
pub trait Extra: Clone + fmt::Debug {
    /// Floats per pixel, for the size of the photo cache.
    fn floats_per_pixel(&self) -> usize {
        0
    }
}

impl Extra for () {}

/// The method's data of a view, by its index.
type MakeExtra<'a, X> = Box<dyn Fn(&View, usize, &Device) -> X + 'a>;

/// Views as tensors, converted when asked for and kept while they fit the cache. Photos that are not in memory are
/// decoded then.
pub struct Photos<'a, X> {
    views: &'a [View],
    device: Device,
    kept: Vec<Option<Photo<X>>>,
    room: usize,
    pixel: f64,
    region: Option<Region>,
    share: f64,
    extra: MakeExtra<'a, X>,
    /// Views that are being decoded, or have been, by index.
    ahead: BTreeMap<usize, JoinHandle<Option<Arc<View>>>>,
}

impl<'a> Photos<'a, ()> {
    /// `views` for `device` (without autodiff), without data of a method, none of them cached.
    pub fn plain(views: &'a [View], device: &Device) -> Self {
        Self::new(views, device, 0, |_, _, _| ())
    }
}

impl<'a, X: Extra> Photos<'a, X> {
    /// `views` for `device` (without autodiff), with at most `cache_bytes` of converted photos cached; `extra` gives
    /// the method's data of a view, by its index.
    pub fn new(
        views: &'a [View],
        device: &Device,
        cache_bytes: usize,
        extra: impl Fn(&View, usize, &Device) -> X + 'a,
    ) -> Self {
        Self {
            views,
            device: device.clone(),
            kept: vec![None; views.len()],
            room: cache_bytes,
            pixel: 1.0,
            region: None,
            share: 1.0,
            extra: Box::new(extra),
            ahead: BTreeMap::new(),
        }
    }

    /// The same, of views whose pixels are `pixel` times as wide as those of the scene's photos.
    pub fn of_width(self, pixel: f64) -> Self {
        Self { pixel, ..self }
    }

    /// The same, of which only pixels count whose rays meet `region`, if there is one.
    pub fn within(self, region: Option<Region>) -> Self {
        let share = region.map_or(1.0, |region| region.share(self.views));
        Self { region, share, ..self }
    }

    /// The views themselves.
    pub fn views(&self) -> &'a [View] {
        self.views
    }

    /// Whether photos are decoded when they are asked for.
    pub fn are_on_demand(&self) -> bool {
        self.views.first().is_some_and(|view| view.source.is_some())
    }

    /// Begins to decode the photos of views that will be asked for, each on a thread of its own; does nothing about
    /// those in memory.
    pub fn prefetch(&mut self, indices: impl IntoIterator<Item = usize>) {
        for index in indices {
            let view = &self.views[index];
            if view.source.is_none() || self.kept[index].is_some() || self.ahead.contains_key(&index) {
                continue;
            }
            let view = view.clone();
            // Without a thread the photo is decoded when it is asked for.
            if let Ok(thread) = thread::Builder::new().spawn(move || view.asked()) {
                self.ahead.insert(index, thread);
            }
        }
    }

    /// View `index` with its pixels.
    pub fn view(&mut self, index: usize) -> Decoded<'a> {
        let ahead = self.ahead.remove(&index).and_then(|thread| thread.join().ok().flatten());
        ahead.map_or_else(|| self.views[index].decoded(), Decoded::Asked)
    }

    /// View `index` on the device.
    pub fn get(&mut self, index: usize) -> Photo<X> {
        if let Some(photo) = &self.kept[index] {
            return photo.clone();
        }
        let view = self.view(index);
        self.of(&view, index)
    }

    /// View `index`, which has its pixels, on the device.
    pub fn of(&mut self, view: &View, index: usize) -> Photo<X> {
        let photo = self.upload(view, index);
        let channels = 3 + usize::from(photo.mask.is_some()) + photo.extra.floats_per_pixel();
        let bytes = 4 * view.width * view.height * channels;
        if bytes <= self.room {
            self.room -= bytes;
            self.kept[index] = Some(photo.clone());
        }
        photo
    }

    fn upload(&self, view: &View, index: usize) -> Photo<X> {
        let device = &self.device;
        Photo {
            camera: camera(view, device),
            image: colors_of(view, device),
            mask: match self.region {
                Some(region) => Some(to_tensor(view, &region.mask(view), 1, device)),
                None => mask_of(view, device),
            },
            time: view.time.unwrap_or(0.0),
            pixel: self.pixel,
            share: self.share,
            index,
            color: None,
            path: None,
            extra: (self.extra)(view, index, device),
        }
    }
}

/// The camera of a view.
pub fn camera(view: &View, device: &Device) -> Camera {
    Camera::from_c2w(view.c2w, view.intrinsics, view.width, view.height, device)
}

/// The mask of a view, `[H, W, 1]`: 1 where it counts; `None` if every pixel does.
pub fn mask_of(view: &View, device: &Device) -> Option<Tensor<3>> {
    view.mask.as_ref().map(|mask| to_tensor(view, mask, 1, device))
}

/// The colours of a view that has its pixels, `[H, W, 3]`, 0 to 1, at the depth of its file.
pub fn colors_of(view: &View, device: &Device) -> Tensor<3> {
    if view.fine.is_none() {
        return to_tensor(view, &view.image.data, 3, device);
    }
    let levels = (0..view.image.data.len()).into_par_iter().with_min_len(1 << 14);
    let floats: Vec<f32> = levels.map(|index| view.level(index) / 255.0).collect();
    Tensor::from_data(TensorData::new(floats, [view.height, view.width, 3]), device)
}

/// Bytes of an image of the view's size as floats from 0 to 1, `[H, W, channels]`.
pub fn to_tensor(view: &View, bytes: &[u8], channels: usize, device: &Device) -> Tensor<3> {
    image_tensor(bytes, [view.height, view.width, channels], device)
}

/// Bytes of an image as floats from 0 to 1.
pub fn image_tensor(bytes: &[u8], shape: [usize; 3], device: &Device) -> Tensor<3> {
    let floats: Vec<f32> = bytes.par_iter().with_min_len(1 << 14).map(|b| f32::from(*b) / 255.0).collect();
    Tensor::from_data(TensorData::new(floats, shape), device)
}
