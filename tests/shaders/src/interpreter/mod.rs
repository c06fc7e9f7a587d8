//! Runs a compute shader in WGSL, unit by unit in a random order, over a memory that watches.
//!
//! A unit runs to the next barrier, then another one does; so what happens between two barriers has one order here,
//! and every other order is found by its traces: each word remembers who read and wrote it since the last barrier, and
//! a touch that another order would change is a [`Wrong::Race`], whatever the value. Barriers of WGSL's
//! `workgroupBarrier` order shared memory alone; buffers are in order within a cube only behind `storageBarrier`, and
//! between cubes never.

mod around;
mod code;
mod fault;
mod lower;
mod math;
mod memory;
mod statements;
mod unit;
mod value;

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Barrier, Handle, Module, Span};
use rand::seq::SliceRandom;
use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

use around::Around;
pub use around::Binding;
use code::Code;
pub use fault::{Fault, Wrong};
use lower::Lowering;
pub use memory::Memory;
use unit::{Stop, Unit};
use value::{Kind, Value, Words};

/// Units of a warp: they keep together where the order of warps is random.
const WARP: usize = 32;

/// A shader, ready to run.
pub struct Program {
    source: String,
    module: Module,
    code: Code,
    /// Words of each shared variable.
    shared: Vec<usize>,
    size: [u32; 3],
}

/// A launch of a program.
pub struct Launch<'a> {
    /// Cubes along three axes.
    pub cubes: [u32; 3],
    /// The memories to which the shader's bindings lead, by their number.
    pub bindings: &'a [Binding],
    /// All allocations.
    pub memories: &'a mut [Memory],
    /// Number of the launch; a larger one than any before on these allocations.
    pub number: u32,
    /// Of the order of units and cubes, and of the values of memory that nobody has written.
    pub seed: u64,
    /// Whether shared memory that nobody has written may be read: its values then come from the seed.
    pub forgiving: bool,
}

/// Parses and checks a shader.
///
/// # Errors
/// When the text is no valid WGSL for naga.
pub fn validated(wgsl: &str) -> Result<(Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(wgsl).map_err(|error| error.emit_to_string(wgsl))?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    let info = validator.validate(&module).map_err(|error| error.emit_to_string(wgsl))?;
    Ok((module, info))
}

impl Program {
    /// The first entry point of a shader.
    ///
    /// # Errors
    /// When the text is no valid WGSL for naga, or has no entry point.
    pub fn of(wgsl: &str) -> Result<Self, String> {
        let (module, info) = validated(wgsl)?;
        let globals: Vec<Handle<_>> = module
            .global_variables
            .iter()
            .filter(|(_, variable)| variable.space == AddressSpace::WorkGroup)
            .map(|(handle, _)| handle)
            .collect();
        let words = |handle: &Handle<_>| lower::words_of(&module, module.global_variables[*handle].ty) as usize;
        let shared = globals.iter().map(words).collect();
        let entry = module.entry_points.first().ok_or("no entry point")?;
        let code = Lowering::of(&module, &entry.function, info.get_entry_point(0), &globals);
        let size = entry.workgroup_size;
        Ok(Self { source: wgsl.into(), code, shared, size, module })
    }

    /// Words of shared memory.
    pub fn shared_words(&self) -> usize {
        self.shared.iter().sum()
    }

    /// Runs all cubes. Returns whether a read was forgiven.
    ///
    /// # Errors
    /// The first fault.
    pub fn run(&self, launch: &mut Launch) -> Result<bool, Fault> {
        let mut random = ChaCha8Rng::seed_from_u64(launch.seed);
        let mut shared: Vec<Memory> =
            self.shared.iter().map(|len| Memory::unwritten(*len, || random.next_u32())).collect();
        let mut cubes: Vec<u32> = (0..launch.cubes.iter().product()).collect();
        cubes.shuffle(&mut random);
        let mut units: Vec<Unit> = (0..self.size.iter().product()).map(|number| self.unit(number)).collect();
        let mut forgave = false;
        for cube in cubes {
            shared.iter_mut().for_each(|memory| memory.forget(|| random.next_u32()));
            units.iter_mut().for_each(|unit| self.begin(unit, cube, launch.cubes));
            forgave |= self.run_cube(launch, cube, &mut shared, &mut units, &mut random)?;
        }
        Ok(forgave)
    }

    fn run_cube(
        &self,
        launch: &mut Launch,
        cube: u32,
        shared: &mut [Memory],
        units: &mut [Unit],
        random: &mut ChaCha8Rng,
    ) -> Result<bool, Fault> {
        let mut around = Around {
            code: &self.code,
            bindings: launch.bindings,
            memories: launch.memories,
            shared,
            launch: launch.number,
            cube,
            phases: [0; 2],
            forgiving: launch.forgiving,
            forgave: false,
        };
        loop {
            let mut stops = vec![Stop::End; units.len()];
            for k in order(units.len(), random) {
                let unit = &mut units[k];
                let step = |unit: &Unit| unit.next.saturating_sub(1);
                stops[k] = unit.run(&mut around).map_err(|(wrong, at)| {
                    let span = at.map_or(self.code.spans[step(unit)], |at| self.span(at));
                    self.fault(wrong, cube, unit.number, span)
                })?;
            }
            if let Some(k) = stops.iter().position(|stop| *stop != stops[0]) {
                let waiting = if stops[k] == Stop::End { 0 } else { k };
                let span = self.code.spans[units[waiting].next - 1];
                return Err(self.fault(Wrong::Divergence, cube, waiting as u32, span));
            }
            let Stop::Barrier { flags, .. } = stops[0] else { return Ok(around.forgave) };
            for (phase, kind) in around.phases.iter_mut().zip([Barrier::WORK_GROUP, Barrier::STORAGE]) {
                *phase += u32::from(flags.contains(kind));
            }
        }
    }

    fn unit(&self, number: u32) -> Unit {
        Unit { number, next: 0, values: self.code.ready.clone(), own: self.code.own.clone(), steps: 0 }
    }

    /// Puts a unit to the begin of a cube. Results of an earlier cube stay: each is computed again before it is used.
    fn begin(&self, unit: &mut Unit, cube: u32, cubes: [u32; 3]) {
        let place =
            |number: u32, size: [u32; 3]| [number % size[0], number / size[0] % size[1], number / size[0] / size[1]];
        let (local, group) = (place(unit.number, self.size), place(cube, cubes));
        (unit.next, unit.steps) = (0, 0);
        unit.own.copy_from_slice(&self.code.own);
        for (at, what) in &self.code.arguments {
            let three = |words: [u32; 3]| Value::Words(Words::of(Kind::U32, &words));
            unit.values[*at] = match what {
                naga::BuiltIn::LocalInvocationIndex => Value::Words(Words::scalar(Kind::U32, unit.number)),
                naga::BuiltIn::LocalInvocationId => three(local),
                naga::BuiltIn::WorkGroupId => three(group),
                naga::BuiltIn::NumWorkGroups => three(cubes),
                naga::BuiltIn::GlobalInvocationId => three(std::array::from_fn(|k| group[k] * self.size[k] + local[k])),
                _ => Value::Nothing,
            };
        }
    }

    fn span(&self, at: usize) -> Span {
        let expressions = &self.module.entry_points[0].function.expressions;
        expressions.iter().nth(at).map_or(Span::UNDEFINED, |(handle, _)| expressions.get_span(handle))
    }

    fn fault(&self, wrong: Wrong, cube: u32, unit: u32, span: Span) -> Fault {
        let number = span.location(&self.source).line_number as usize;
        let line = self.source.lines().nth(number.saturating_sub(1)).unwrap_or_default().trim().to_string();
        Fault { wrong, cube, unit, line }
    }
}

/// A random order of units: of each by itself, or of whole warps.
fn order(units: usize, random: &mut ChaCha8Rng) -> Vec<usize> {
    let together = if random.next_u32().is_multiple_of(2) { 1 } else { WARP };
    let mut blocks: Vec<usize> = (0..units.div_ceil(together)).collect();
    blocks.shuffle(random);
    blocks.into_iter().flat_map(|block| (block * together..(block + 1) * together).filter(|k| *k < units)).collect()
}
