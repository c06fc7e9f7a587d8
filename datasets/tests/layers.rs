//! Modules stand in layers: the imports between the files and folders of `src` make no circle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

type Graph = BTreeMap<String, BTreeSet<String>>;

fn sources(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    paths.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

/// First names of the paths that begin with `crate::`, or with as many `super::` as lead to the crate's root from
/// `depth` modules below it. Comments and tests do not count.
fn imports(text: &str, depth: usize) -> Vec<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let code: String = code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
    let code = code.replace(&"super::".repeat(depth), "crate::").replace(char::is_whitespace, "");
    let first = |path: &str| path.split(|c: char| !c.is_alphanumeric() && c != '_').next().map(str::to_string);
    let listed = |rest: &str| match rest.strip_prefix('{').and_then(|list| list.split_once('}')) {
        Some((list, _)) => list.split(',').filter_map(first).collect(),
        None => Vec::from_iter(first(rest)),
    };
    code.split("crate::").skip(1).flat_map(listed).collect()
}

/// A way from `module` back to where it was before, if there is one.
fn circle(graph: &Graph, module: &String, way: &mut Vec<String>, done: &mut BTreeSet<String>) -> Option<String> {
    if let Some(start) = way.iter().position(|before| before == module) {
        return Some(format!("{} -> {module}", way[start..].join(" -> ")));
    }
    if done.contains(module) {
        return None;
    }
    way.push(module.clone());
    let found = graph[module].iter().find_map(|next| circle(graph, next, way, done));
    way.pop();
    done.insert(module.clone());
    found
}

#[test]
fn imports_make_no_circle() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut graph = Graph::new();
    for path in sources(&src) {
        let below = path.strip_prefix(&src).expect("below src").with_extension("");
        let names: Vec<&str> = below.iter().map(|name| name.to_str().expect("a name")).collect();
        let depth = names.iter().filter(|name| **name != "mod").count();
        let text = std::fs::read_to_string(&path).expect("a source file");
        graph.entry(names[0].to_string()).or_default().extend(imports(&text, depth));
    }
    graph.remove("lib");
    let modules: BTreeSet<String> = graph.keys().cloned().collect();
    for (module, imported) in &mut graph {
        imported.retain(|name| name != module && modules.contains(name));
    }
    assert!(graph.values().map(BTreeSet::len).sum::<usize>() > 50, "imports are found: {graph:?}");
    let mut done = BTreeSet::new();
    let found = modules.iter().find_map(|module| circle(&graph, module, &mut Vec::new(), &mut done));
    assert_eq!(found, None, "a circle of imports: move what both need into a module below them");
}
