//! A device of CubeCL that interprets its kernels and keeps a record of them.

mod properties;
mod server;

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use cubecl::client::Client;
use cubecl_core::device::DeviceId;

use server::Interpreter;

/// A kernel as a shader.
#[derive(Clone, Debug)]
pub struct Shader {
    /// Path of its function and the options it was compiled for.
    pub name: String,
    /// The text that wgpu gets.
    pub wgsl: String,
    /// Whether the kernel writes each of its buffers.
    pub writes: Vec<bool>,
}

impl Shader {
    /// Path of the kernel's function, as in `gs_kernels::cube::sort::sort_move_kernel`.
    pub fn function(&self) -> &str {
        let path = self.name.split(['<', ' ']).next().unwrap_or_default();
        path.rsplit_once("::").map_or(path, |(function, _)| function)
    }
}

/// The launches of a device and the faults in them.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Each kernel and variant, in the order of the first launches.
    pub shaders: Vec<Shader>,
    /// Launches of each shader.
    pub launches: Vec<usize>,
    /// Sentences about faults, with the shader's name.
    pub faults: Vec<String>,
    /// Functions that read shared memory that nobody had written, and were forgiven.
    pub forgiven: BTreeSet<String>,
}

/// A device that is open.
pub struct Device {
    /// For the kernels' host code.
    pub client: Client,
    record: Arc<Mutex<Record>>,
}

impl Device {
    /// A device whose units run in an order by `seed`. The functions in `forgiven` may read shared memory that nobody
    /// has written.
    pub fn open(seed: u64, forgiven: &'static [&'static str]) -> Self {
        static COUNT: AtomicU16 = AtomicU16::new(0);
        let id = DeviceId::new(0, COUNT.fetch_add(1, Ordering::Relaxed));
        let server = Interpreter::new(id, seed, forgiven);
        let record = server.record.clone();
        Self { client: Client::init(id, server), record }
    }

    /// The record of all launches so far.
    ///
    /// # Panics
    /// When the device fails.
    pub fn record(&self) -> Record {
        self.client.flush().expect("the device works");
        self.record.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
