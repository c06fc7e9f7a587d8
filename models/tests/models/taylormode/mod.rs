//! TaylorMoDe-GS: motion, blur, losses and model size.

mod blur_path;
mod blur_synthesis;
mod blur_weights;
mod exposure;
mod kinks;
mod losses;
mod order;
mod paths;
mod remainder;
mod shrinkage;
mod summary;
mod taylor_motion;
mod velocity_map;
mod window;
