//! The recipes of `gsburn`, compiled in, so that an installed program has them: the TOML files of this folder, by path
//! without extension.
//!
//! ```
//! let paper = gs_recipes::find("taylormode/paper").expect("a recipe");
//! assert!(paper.text.contains("base = \"base.toml\""));
//! ```

/// A configuration file by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recipe {
    /// Its path in this folder without extension, such as `taylormode/paper`.
    pub name: &'static str,
    /// The file.
    pub text: &'static str,
}

/// A network of the pipeline `flux4d`, trained on synthetic streets alone: a checkpoint without the state of its
/// optimiser. The recipe `flux4d/streets` says how.
pub const STREETS: &[u8] = include_bytes!("flux4d/streets.safetensors");

macro_rules! recipe {
    ($name:literal) => {
        Recipe { name: $name, text: include_str!(concat!($name, ".toml")) }
    };
}

/// All recipes by name.
pub const RECIPES: [Recipe; 54] = [
    recipe!("flux4d/ablations/base-network"),
    recipe!("flux4d/ablations/constant-velocity"),
    recipe!("flux4d/ablations/far-in-voxels"),
    recipe!("flux4d/ablations/no-alignment"),
    recipe!("flux4d/ablations/no-refinement"),
    recipe!("flux4d/ablations/no-reweighting"),
    recipe!("flux4d/ablations/no-velocity-loss"),
    recipe!("flux4d/ablations/raw-feedback"),
    recipe!("flux4d/base"),
    recipe!("flux4d/paper"),
    recipe!("flux4d/paper-future"),
    recipe!("flux4d/streets"),
    recipe!("sparsedyn/ablations/full-horizon"),
    recipe!("sparsedyn/ablations/no-regularisation"),
    recipe!("sparsedyn/ablations/no-outline"),
    recipe!("sparsedyn/ablations/no-replay"),
    recipe!("sparsedyn/ablations/opacity-only"),
    recipe!("sparsedyn/ablations/replay-2"),
    recipe!("sparsedyn/ablations/replay-6"),
    recipe!("sparsedyn/ablations/window-2"),
    recipe!("sparsedyn/ablations/window-3"),
    recipe!("sparsedyn/ablations/window-5"),
    recipe!("sparsedyn/base"),
    recipe!("sparsedyn/baseline-freegave"),
    recipe!("sparsedyn/baseline-trace"),
    recipe!("sparsedyn/field"),
    recipe!("sparsedyn/hybrid"),
    recipe!("sparsedyn/paper"),
    recipe!("sparsedyn/room"),
    recipe!("static/base"),
    recipe!("static/blender"),
    recipe!("static/demo"),
    recipe!("static/fox"),
    recipe!("static/lund-door"),
    recipe!("static/shake"),
    recipe!("taylormode/ablations/no-decoupling"),
    recipe!("taylormode/ablations/no-peano"),
    recipe!("taylormode/ablations/no-pseudo"),
    recipe!("taylormode/ablations/no-reblurring"),
    recipe!("taylormode/ablations/no-regularisers"),
    recipe!("taylormode/ablations/no-smoothness"),
    recipe!("taylormode/ablations/no-taylor"),
    recipe!("taylormode/ablations/no-velocity"),
    recipe!("taylormode/ablations/no-weights"),
    recipe!("taylormode/base"),
    recipe!("taylormode/demo"),
    recipe!("taylormode/everything-moves"),
    recipe!("taylormode/fixed-order"),
    recipe!("taylormode/handheld"),
    recipe!("taylormode/itg"),
    recipe!("taylormode/no-blur"),
    recipe!("taylormode/panoptic"),
    recipe!("taylormode/panoptic-blurred"),
    recipe!("taylormode/paper"),
];

/// The recipe called `name`.
pub fn find(name: &str) -> Option<&'static Recipe> {
    RECIPES.iter().find(|recipe| recipe.name == name)
}

impl Recipe {
    /// The first sentence of the comment that the file begins with.
    pub fn about(&self) -> String {
        let comment = self.text.lines().map_while(|line| line.strip_prefix("# ")).collect::<Vec<_>>().join(" ");
        match comment.split_once(". ") {
            Some((first, _)) => format!("{first}."),
            None => comment,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_recipe_says_what_it_is() {
        for recipe in &RECIPES {
            assert!(
                recipe.about().ends_with('.') || recipe.about().ends_with(':'),
                "{}: {}",
                recipe.name,
                recipe.about()
            );
        }
    }

    #[test]
    fn every_file_is_a_recipe() {
        fn count(folder: &std::path::Path) -> usize {
            let entries =
                std::fs::read_dir(folder).expect("the folder of this crate").flatten().map(|entry| entry.path());
            let files = entries.map(|path| match path.is_dir() {
                true if path.ends_with("target") => 0,
                true => count(&path),
                false => usize::from(path.extension().is_some_and(|e| e == "toml") && !path.ends_with("Cargo.toml")),
            });
            files.sum()
        }
        assert_eq!(count(std::path::Path::new(env!("CARGO_MANIFEST_DIR"))), RECIPES.len());
    }
}
