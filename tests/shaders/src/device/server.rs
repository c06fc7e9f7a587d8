//! The server behind a [`Device`](super::Device): memory on the host, kernels in the interpreter.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use cubecl::bytes::Bytes;

use cubecl::future::DynFut;
use cubecl::ir::TargetProperties;
use cubecl::prelude::KernelId;
use cubecl::profile::ProfileDuration;
use cubecl::server::{
    BufferBinding, CopyDescriptor, CubeCount, IoError, KernelArguments, KernelResource, ProfileError, ProfilingToken,
    Server, ServerCommunication, ServerError, ServerStorage, ServerUtilities,
};
use cubecl::wgpu::WgslCompiler;
use cubecl::{Compiler, CubeKernel, MemoryAllocationMode, StreamMemoryReport, define_kernel};
use cubecl_core::device::{DeviceId, DeviceService, ServerUtilitiesHandle, ServiceId};
use cubecl_core::environment::stream::StreamId;
use cubecl_server::allocator::ContiguousMemoryLayoutPolicy;
use cubecl_server::dry_run::LaunchMode;
use cubecl_server::logging::ServerLogger;
use cubecl_server::memory_management::{ManagedMemoryHandle, ManagedMemoryId, WeakMemoryBinding};
use cubecl_server::storage::{ComputeStorage, ManagedResource, StorageHandle, StorageId};
use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::properties::{ALIGNMENT, properties};
use super::{Record, Shader};
use crate::interpreter::{Binding, Launch, Memory, Program};

/// A kernel that was compiled.
struct Compiled {
    number: usize,
    function: String,
    program: Result<Program, String>,
}

/// The server.
pub(super) struct Interpreter {
    utilities: Arc<ServerUtilities>,
    random: ChaCha8Rng,
    forgiven: &'static [&'static str],
    compiled: HashMap<KernelId, Arc<Compiled>>,
    memories: Vec<Memory>,
    /// The host's hold on each allocation.
    held: Vec<WeakMemoryBinding>,
    of_handle: HashMap<ManagedMemoryId, usize>,
    launches: u32,
    pub record: Arc<Mutex<Record>>,
}

impl std::fmt::Debug for Interpreter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Interpreter").finish_non_exhaustive()
    }
}

impl Interpreter {
    pub fn new(id: DeviceId, seed: u64, forgiven: &'static [&'static str]) -> Self {
        let (utilities, _) = ServerUtilities::init(
            ServiceId::of::<Self>(id),
            "interpreter",
            properties(),
            TargetProperties { mma: Default::default() },
            Arc::new(ServerLogger::default()),
            ContiguousMemoryLayoutPolicy::new(ALIGNMENT),
        );
        Self {
            utilities: Arc::new(utilities),
            random: ChaCha8Rng::seed_from_u64(seed),
            forgiven,
            compiled: HashMap::new(),
            memories: Vec::new(),
            held: Vec::new(),
            of_handle: HashMap::new(),
            launches: 0,
            record: Arc::default(),
        }
    }

    fn noted<T>(&self, note: impl FnOnce(&mut Record) -> T) -> T {
        note(&mut self.record.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The shader of a kernel, compiled at its first launch.
    fn compiled(&mut self, kernel: &dyn CubeKernel) -> Result<Arc<Compiled>, String> {
        let id = kernel.id();
        if let Some(compiled) = self.compiled.get(&id) {
            return Ok(compiled.clone());
        }
        let definition = define_kernel(kernel).map_err(|error| error.to_string())?;
        let mut compiler = WgslCompiler;
        let shader = compiler.compile(definition, &Default::default()).map_err(|error| error.to_string())?;
        let writes = WgslCompiler::buffer_io(&shader).into_iter().flatten().map(|io| io.is_writable()).collect();
        let wgsl = shader.to_string();
        let name = format!("{} {id:?}", kernel.name());
        let program = Program::of(&wgsl);
        let shader = Shader { name, wgsl, writes };
        let function = shader.function().to_string();
        let number = self.noted(|record| {
            record.shaders.push(shader);
            record.launches.push(0);
            record.shaders.len() - 1
        });
        let compiled = Arc::new(Compiled { number, function, program });
        self.compiled.insert(id, compiled.clone());
        Ok(compiled)
    }

    /// The words that a binding of the host names.
    fn binding(&self, binding: &BufferBinding) -> Option<Binding> {
        let range = binding.range();
        let memory = *self.of_handle.get(&binding.memory.id())?;
        Some(Binding { memory, at: range.start as usize / 4, len: (range.end - range.start) as usize / 4 })
    }

    fn interpret(
        &mut self,
        kernel: &dyn CubeKernel,
        count: CubeCount,
        arguments: KernelArguments,
    ) -> Result<(), String> {
        let compiled = self.compiled(kernel)?;
        self.noted(|record| record.launches[compiled.number] += 1);
        let program = compiled.program.as_ref().map_err(String::clone)?;
        let CubeCount::Static(x, y, z) = count else { return Err("cubes counted on the device".into()) };
        let mut bindings = Vec::new();
        for resource in &arguments.resources {
            let KernelResource::Buffer(buffer) = resource else { return Err("an unknown resource".into()) };
            bindings.push(self.binding(buffer).ok_or("a buffer that was never allocated")?);
        }
        let numbers: Vec<u32> =
            arguments.info.data.iter().flat_map(|word| [*word as u32, (*word >> 32) as u32]).collect();
        bindings.push(Binding { memory: self.memories.len(), at: 0, len: numbers.len() });
        self.memories.push(Memory::of(numbers));
        self.launches += 1;
        let launch = &mut Launch {
            cubes: [x, y, z],
            bindings: &bindings,
            memories: &mut self.memories,
            number: self.launches,
            seed: self.random.next_u64(),
            forgiving: self.forgiven.contains(&&*compiled.function),
        };
        let result = program.run(launch).map_err(|fault| fault.to_string());
        self.memories.pop();
        if result? {
            self.noted(|record| record.forgiven.insert(compiled.function.clone()));
        }
        Ok(())
    }
}

impl DeviceService for Interpreter {
    fn init(id: DeviceId) -> Self {
        Self::new(id, 0, &[])
    }

    fn utilities(&self) -> ServerUtilitiesHandle {
        self.utilities.clone()
    }
}

impl ServerCommunication for Interpreter {}

impl Server for Interpreter {
    fn initialize_memory(&mut self, memory: ManagedMemoryHandle, size: u64, _: StreamId) -> Result<(), ServerError> {
        let mut random = ChaCha8Rng::seed_from_u64(self.random.next_u64());
        let free = self.held.iter().zip(&mut self.memories).filter(|(held, _)| !held.is_alive());
        free.for_each(|(_, memory)| *memory = Memory::default());
        let binding = memory.binding();
        self.of_handle.insert(binding.id(), self.memories.len());
        self.held.push(binding.downgrade());
        self.memories.push(Memory::unwritten((size as usize).div_ceil(4), || random.next_u32()));
        Ok(())
    }

    fn logger(&self) -> Arc<ServerLogger> {
        self.utilities.logger.clone()
    }

    fn utilities(&self) -> Arc<ServerUtilities> {
        self.utilities.clone()
    }

    fn read(&mut self, wanted: Vec<CopyDescriptor>, _: StreamId) -> DynFut<Result<Vec<Bytes>, ServerError>> {
        let read = |descriptor: CopyDescriptor| {
            let Binding { memory, at, len } = self.binding(&descriptor.handle).expect("the host reads what it has");
            if !self.memories[memory].all_written(at..at + len) {
                self.noted(|record| record.faults.push("the host reads words that no kernel has written".into()));
            }
            let bytes: Vec<u8> =
                self.memories[memory].words()[at..at + len].iter().flat_map(|word| word.to_le_bytes()).collect();
            Bytes::from_bytes_vec(bytes)
        };
        let bytes = wanted.into_iter().map(read).collect();
        Box::pin(std::future::ready(Ok(bytes)))
    }

    fn write(&mut self, given: Vec<(CopyDescriptor, Bytes)>, _: StreamId) {
        for (descriptor, bytes) in given {
            let words: Vec<u32> = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
            let Binding { memory, at, .. } = self.binding(&descriptor.handle).expect("the host writes what it has");
            self.memories[memory].put(at, &words);
        }
    }

    fn sync(&mut self, _: Vec<BufferBinding>, _: StreamId) -> DynFut<Result<(), ServerError>> {
        Box::pin(std::future::ready(Ok(())))
    }

    fn check(&mut self, _: Vec<BufferBinding>, _: StreamId) -> Result<(), ServerError> {
        Ok(())
    }

    unsafe fn launch(
        &mut self,
        kernel: Box<dyn CubeKernel>,
        count: CubeCount,
        arguments: KernelArguments,
        _: StreamId,
        _: LaunchMode,
    ) {
        if let Err(fault) = self.interpret(&*kernel, count, arguments) {
            self.noted(|record| record.faults.push(format!("{}: {fault}", kernel.name())));
        }
    }

    fn flush(&mut self, _: StreamId) -> Result<(), ServerError> {
        Ok(())
    }

    fn memory_report(&mut self, _: StreamId) -> Option<StreamMemoryReport> {
        None
    }

    fn memory_cleanup(&mut self, _: StreamId) -> Result<(), ServerError> {
        Ok(())
    }

    fn start_profile(&mut self, _: StreamId) -> Result<ProfilingToken, ServerError> {
        Ok(ProfilingToken { id: 0 })
    }

    fn end_profile(&mut self, _: StreamId, _: ProfilingToken) -> Result<ProfileDuration, ProfileError> {
        unreachable!("nothing is profiled")
    }

    fn allocation_mode(&mut self, _: MemoryAllocationMode, _: StreamId) {}
}

/// The host reaches memory through reads and writes alone, so there is nothing to hand out.
pub(super) struct NoStorage;

impl ComputeStorage for NoStorage {
    type Resource = ();

    fn alignment(&self) -> usize {
        ALIGNMENT
    }

    fn get(&mut self, _: &StorageHandle) -> Result<(), IoError> {
        Ok(())
    }

    fn alloc(&mut self, _: u64) -> Result<StorageHandle, IoError> {
        unreachable!("memory is allocated by handles")
    }

    fn dealloc(&mut self, _: StorageId) {}

    fn flush(&mut self) {}

    fn bytes_allocated(&self) -> u64 {
        0
    }
}

impl ServerStorage for Interpreter {
    type Storage = NoStorage;

    fn get_resource(&mut self, _: BufferBinding, _: StreamId) -> Result<ManagedResource<()>, ServerError> {
        unreachable!("no resource is handed out")
    }
}
