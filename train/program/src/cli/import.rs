//! Arguments of `import`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;
use gs_datasets::DepthKind;

use gs_pipelines::examples;

/// Arguments of `import`.
#[derive(Debug, Args)]
#[command(after_help = examples::IMPORT)]
pub struct ImportArgs {
    /// A folder of depth files that are named after the photos: NAME.npy, NAME.exr or NAME.png
    #[arg(value_hint = ValueHint::DirPath)]
    pub depths: PathBuf,

    /// The data set with cameras and points that the priors are for
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub into: PathBuf,

    /// The folder of the priors [default: priors/depth beside the photos, where a data set with times is searched for
    /// them]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// Meaning of the numbers: depth or inverse_depth [default: inverse depth in 8-bit pictures, else depth]
    #[arg(long, value_name = "KIND", value_parser = kind)]
    pub kind: Option<DepthKind>,
}

fn kind(word: &str) -> Result<DepthKind, String> {
    match word {
        "depth" => Ok(DepthKind::Depth),
        "inverse_depth" => Ok(DepthKind::InverseDepth),
        _ => Err("expected depth or inverse_depth".into()),
    }
}
