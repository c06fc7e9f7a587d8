//! Every shader in the languages of all targets.

use std::io::Write;
use std::process::Command;

use gs_shaders::device::Shader;
use gs_shaders::interpreter::validated;
use naga::back::{hlsl, msl, spv};
use naga::valid::ModuleInfo;
use naga::{Module, ShaderStage};

use crate::dump::record;

/// The least versions of Metal's language that wgpu asks for, and of SPIR-V.
const METAL: (u8, u8) = (2, 0);
const SPIRV: (u8, u8) = (1, 3);

/// Register of the numbers of cubes, which HLSL has no name for: any that no buffer has.
const CUBES: hlsl::BindTarget = hlsl::BindTarget {
    space: 1,
    register: 0,
    binding_array_size: None,
    dynamic_storage_buffer_offsets_index: None,
    restrict_indexing: false,
};

fn to_metal(module: &Module, info: &ModuleInfo) -> Result<usize, String> {
    let options =
        msl::Options { lang_version: METAL, zero_initialize_workgroup_memory: false, ..msl::Options::default() };
    let written = msl::write_string(module, info, &options, &msl::PipelineOptions::default());
    let (text, names) = written.map_err(|error| error.to_string())?;
    names.entry_point_names.into_iter().try_for_each(|name| name.map(|_| ())).map_err(|error| error.to_string())?;
    Ok(text.len())
}

fn to_hlsl(module: &Module, info: &ModuleInfo, shader_model: hlsl::ShaderModel) -> Result<usize, String> {
    let options = hlsl::Options {
        shader_model,
        special_constants_binding: Some(CUBES),
        zero_initialize_workgroup_memory: false,
        ..hlsl::Options::default()
    };
    let (mut text, pipeline) = (String::new(), hlsl::PipelineOptions::default());
    let written = hlsl::Writer::new(&mut text, &options, &pipeline).write(module, info, None);
    let names = written.map_err(|error| error.to_string())?.entry_point_names;
    names.into_iter().try_for_each(|name| name.map(|_| ())).map_err(|error| error.to_string())?;
    Ok(text.len())
}

fn to_spirv(module: &Module, info: &ModuleInfo) -> Result<usize, String> {
    let options = spv::Options {
        lang_version: SPIRV,
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        ..spv::Options::default()
    };
    let entry_point = module.entry_points[0].name.clone();
    let pipeline = spv::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point };
    let words = spv::write_vec(module, info, &options, Some(&pipeline)).map_err(|error| error.to_string())?;
    Ok(words.len())
}

#[test]
fn naga_writes_every_language() {
    for shader in &record().shaders {
        let name = &shader.name;
        let (module, info) = validated(&shader.wgsl).unwrap_or_else(|error| panic!("{name}: {error}"));
        let written = [
            ("Metal", to_metal(&module, &info)),
            ("HLSL 5.1", to_hlsl(&module, &info, hlsl::ShaderModel::V5_1)),
            ("HLSL 6.0", to_hlsl(&module, &info, hlsl::ShaderModel::V6_0)),
            ("SPIR-V", to_spirv(&module, &info)),
        ];
        for (language, length) in written {
            let length = length.unwrap_or_else(|error| panic!("{name} in {language}: {error}"));
            assert!(length > 0, "{name} in {language}: no text");
        }
    }
}

/// The text with `read` for the buffers that the kernel only reads, as CubeCL writes it for a browser.
fn as_read(shader: &Shader) -> String {
    let mut text = shader.wgsl.clone();
    for (binding, _) in shader.writes.iter().enumerate().filter(|(_, writes)| !**writes) {
        let written = format!("@binding({binding}) var<storage, read_write>");
        assert!(text.contains(&written), "{}: no binding {binding}", shader.name);
        text = text.replace(&written, &format!("@binding({binding}) var<storage, read>"));
    }
    text
}

/// Tint's message about a shader, if it refuses it.
fn refused(wgsl: &str) -> Option<String> {
    let mut file = tempfile::Builder::new().suffix(".wgsl").tempfile().expect("a file");
    file.write_all(wgsl.as_bytes()).expect("a file");
    let output = Command::new("tint").args(["--format", "wgsl"]).arg(file.path()).output().expect("tint runs");
    (!output.status.success()).then(|| String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn tint_takes_every_shader() {
    if Command::new("tint").arg("--help").output().is_err() {
        println!("without `tint` on the path nothing is checked");
        return;
    }
    for shader in &record().shaders {
        for (what, text) in [("as written", shader.wgsl.clone()), ("with `read`", as_read(shader))] {
            if let Some(error) = refused(&text) {
                panic!("{} {what}: {error}", shader.name);
            }
        }
    }
}
