//! The interpreter finds planted faults, and none where there is none.

use gs_shaders::interpreter::{Binding, Fault, Launch, Memory, Program, Wrong};

/// A shader of 64 units with a buffer of 128 words and shared memory of 64.
fn shader(body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read_write> data: array<u32>;
        var<workgroup> shared_words: array<u32, 64>;
        var<workgroup> total: atomic<u32>;
        @compute @workgroup_size(64, 1, 1)
        fn main(@builtin(local_invocation_index) unit: u32, @builtin(workgroup_id) cube: vec3<u32>) {{
            {body}
        }}"
    )
}

/// Runs two cubes in several orders: the first fault, or the words.
fn run(body: &str) -> Result<Vec<u32>, Fault> {
    let program = Program::of(&shader(body)).expect("valid WGSL");
    let mut words = Vec::new();
    for seed in 0..4 {
        let mut memories = [Memory::of(vec![0; 128])];
        let bindings = [Binding { memory: 0, at: 0, len: 128 }];
        let memories_of = &mut memories;
        let cubes = [2, 1, 1];
        program.run(&mut Launch {
            cubes,
            bindings: &bindings,
            memories: memories_of,
            number: 1,
            seed,
            forgiving: false,
        })?;
        words = memories[0].words().to_vec();
    }
    Ok(words)
}

fn wrong(body: &str) -> Option<(Wrong, String)> {
    run(body).err().map(|fault| (fault.wrong, fault.line))
}

fn found(wrong: Wrong, line: &str) -> Option<(Wrong, String)> {
    Some((wrong, line.to_string()))
}

#[test]
fn a_right_shader_is_right() {
    let words = run("
        shared_words[unit] = unit * unit;
        if unit == 0u { atomicStore(&total, 0u); }
        workgroupBarrier();
        atomicAdd(&total, 2u);
        workgroupBarrier();
        var sum = 0u;
        for (var k = 0u; k < 4u; k += 1u) {
            if k == 2u { continue; }
            sum += shared_words[(unit + k) % 64u];
        }
        switch unit { case 1u: { sum = 7u; } default: { } }
        data[cube.x * 64u + unit] = sum + atomicLoad(&total);
    ");
    let square = |k: u32| (k % 64) * (k % 64);
    let expected = |unit: u32| if unit == 1 { 7 } else { square(unit) + square(unit + 1) + square(unit + 3) } + 128;
    assert_eq!(words.expect("no fault"), [0..64, 0..64].map(|units| units.map(expected).collect::<Vec<_>>()).concat());
}

#[test]
fn shared_memory_that_nobody_has_written() {
    let line = "data[cube.x * 64u + unit] = shared_words[unit];";
    assert_eq!(wrong(line), found(Wrong::Unwritten, line));
    // Another cube has written it.
    let line = "data[cube.x * 64u + unit] = shared_words[63u - unit];";
    let body = format!("if unit < 63u {{ shared_words[unit] = 1u; }}\nworkgroupBarrier();\n{line}");
    assert_eq!(wrong(&body), found(Wrong::Unwritten, line));
}

#[test]
fn races_in_shared_memory() {
    let kind = |body: &str| wrong(body).map(|(wrong, _)| wrong);
    let race = Some(Wrong::Race);
    // A read of another unit's word without a barrier, a write over it after the last read, two writes.
    assert_eq!(
        kind("shared_words[unit] = 1u;\nworkgroupBarrier();\nshared_words[unit] = shared_words[(unit + 1u) % 64u];"),
        race
    );
    assert_eq!(kind("shared_words[unit / 2u] = unit;"), race);
    // The same value is a race too.
    assert_eq!(kind("shared_words[0] = 1u;"), race);
    // An atomic addition before the word was set.
    assert_eq!(kind("if unit == 0u { atomicStore(&total, 0u); }\nworkgroupBarrier();\natomicAdd(&total, 1u);"), None);
    let uniform = "let all = workgroupUniformLoad(&shared_words[0]);";
    let first = "if unit == 0u { shared_words[0] = 1u; }";
    assert_eq!(kind(&format!("{first}\n{uniform}\ndata[cube.x * 64u + unit] = all;")), None);
    // Behind the load there is no barrier on every target.
    assert_eq!(kind(&format!("{first}\n{uniform}\nif unit == all {{ shared_words[0] = 2u; }}")), race);
}

#[test]
fn races_in_buffers() {
    let kind = |body: &str| wrong(body).map(|(wrong, _)| wrong);
    let race = Some(Wrong::Race);
    // Within a cube, also behind a barrier of shared memory alone; between cubes also behind one of buffers.
    let (own, next) = ("data[cube.x * 64u + unit] = unit;", "let x = data[cube.x * 64u + 63u - unit];");
    assert_eq!(kind(&format!("{own}\n{next}\nshared_words[unit] = x;")), race);
    assert_eq!(kind(&format!("{own}\nworkgroupBarrier();\n{next}\nshared_words[unit] = x;")), race);
    assert_eq!(kind(&format!("{own}\nstorageBarrier();\n{next}\nshared_words[unit] = x;")), None);
    let other = "let x = data[64u - cube.x * 64u + unit];";
    assert_eq!(kind(&format!("{own}\nstorageBarrier();\n{other}\nshared_words[unit] = x;")), race);
    assert_eq!(kind("data[unit] = unit;"), race);
}

#[test]
fn barriers_that_not_all_units_reach() {
    let kind = |body: &str| wrong(body).map(|(wrong, _)| wrong);
    let line = "workgroupBarrier();";
    let body = format!("if unit < 32u {{\n{line}\n}}");
    assert_eq!(wrong(&body), found(Wrong::Divergence, line));
    assert_eq!(kind("if unit == 5u { return; }\nworkgroupBarrier();"), Some(Wrong::Divergence));
    assert_eq!(kind("for (var k = 0u; k < unit; k += 1u) { workgroupBarrier(); }"), Some(Wrong::Divergence));
    // Two barriers are not one.
    assert_eq!(kind("if unit < 32u { workgroupBarrier(); } else { workgroupBarrier(); }"), Some(Wrong::Divergence));
    assert_eq!(kind("if cube.x == 0u { return; }\nworkgroupBarrier();"), None);
}

#[test]
fn indices_beyond_their_arrays() {
    let line = "data[cube.x * 64u + unit + 1u] = 1u;";
    assert_eq!(wrong(line), found(Wrong::Bounds, line));
    let line = "shared_words[unit + 1u] = 1u;";
    assert_eq!(wrong(line), found(Wrong::Bounds, line));
    let line = "let x = array_of_own[unit];";
    let body = format!("var array_of_own: array<u32, 63>;\n{line}\nshared_words[unit] = x;");
    assert_eq!(wrong(&body), found(Wrong::Bounds, line));
    // An index alone harms nobody.
    assert_eq!(wrong("let place = &data[unit + 4000u];\nif unit > 64u { *place = 1u; }"), None);
}

#[test]
fn a_loop_without_an_end() {
    assert_eq!(wrong("loop { if unit > 64u { break; } }").map(|(wrong, _)| wrong), Some(Wrong::Endless));
}
