//! The modules of a folder do not import each other in circles, so that a file can be read without the files that use
//! it.
//!
//! In every folder, its files and subfolders are compared; everything inside a subfolder counts as that subfolder. A
//! module may use what its parent's own file defines. Paths inside macros are not seen. Tests may use the crate's door
//! like everybody else.

use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syn::visit::Visit;
use syn::{Item, UseTree};

/// The root of every crate: its folder and its first file.
const CRATES: [[&str; 2]; 10] = [
    ["addons/python/src", "lib.rs"],
    ["coordinator/core/src", "lib.rs"],
    ["coordinator/src", "lib.rs"],
    ["proto/src", "lib.rs"],
    ["shared/gpu/src", "lib.rs"],
    ["shared/image/src", "lib.rs"],
    ["shared/render/src", "lib.rs"],
    ["shared/scene/src", "lib.rs"],
    ["tests/harness/src", "lib.rs"],
    ["worker/src", "lib.rs"],
];

type Names = Vec<String>;

/// What a file imports and defines.
#[derive(Default)]
struct Module {
    /// Names of its items.
    items: BTreeSet<String>,
    /// Names that it imports, and from where; `*` for a whole module.
    imports: Vec<(String, Names)>,
    /// All paths that lead out of it.
    paths: BTreeSet<Names>,
}

struct Reader<'a> {
    /// Path of the module being read, including inline modules.
    here: Names,
    /// How many of these are inline.
    inline: usize,
    module: &'a mut Module,
}

impl Reader<'_> {
    /// A path as names from the crate's root, if it leads out of the file.
    fn absolute(&self, names: &[String]) -> Option<Names> {
        let mut at = match names.first()?.as_str() {
            "crate" => Vec::new(),
            "self" => self.here.clone(),
            "super" => self.here[..self.here.len().checked_sub(1)?].to_vec(),
            name if self.module.items.contains(name) && self.inline == 0 => [&*self.here, &[name.to_owned()]].concat(),
            _ => return None,
        };
        for name in &names[1..] {
            match name.as_str() {
                "super" => drop(at.pop()),
                _ => at.push(name.clone()),
            }
        }
        Some(at)
    }

    fn import(&mut self, before: &mut Names, tree: &UseTree) {
        let (name, target) = match tree {
            UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.import(before, &path.tree);
                before.pop();
                return;
            }
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.import(before, tree));
            }
            UseTree::Name(name) if name.ident == "self" => (before.last().cloned().unwrap_or_default(), before.clone()),
            UseTree::Name(name) => {
                let name = name.ident.to_string();
                (name.clone(), [&**before, &[name]].concat())
            }
            UseTree::Rename(rename) => {
                let target = [&**before, &[rename.ident.to_string()]].concat();
                (rename.rename.to_string(), target)
            }
            UseTree::Glob(_) => ("*".to_owned(), before.clone()),
        };
        if let Some(target) = self.absolute(&target) {
            self.module.paths.insert(target.clone());
            if self.inline == 0 {
                self.module.imports.push((name, target));
            }
        }
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if item.content.is_some() && !is_test(item) {
            self.here.push(item.ident.to_string());
            self.inline += 1;
            syn::visit::visit_item_mod(self, item);
            self.inline -= 1;
            self.here.pop();
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.import(&mut Vec::new(), &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Names = path.segments.iter().map(|s| s.ident.to_string()).collect();
        if let Some(target) = self.absolute(&names) {
            self.module.paths.insert(target);
        }
        syn::visit::visit_path(self, path);
    }
}

/// Whether a module is only for tests.
fn is_test(module: &syn::ItemMod) -> bool {
    let is_test = |attribute: &syn::Attribute| {
        attribute.path().is_ident("cfg")
            && attribute
                .parse_args::<syn::Path>()
                .is_ok_and(|path| path.is_ident("test"))
    };
    module.attrs.iter().any(is_test)
}

fn name_of(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Mod(item) => &item.ident,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

/// The modules of a crate, by path.
fn modules(root: &Path, first: &str) -> BTreeMap<Names, Module> {
    let mut modules = BTreeMap::new();
    read_module(&root.join(first), root, Vec::new(), &mut modules);
    modules
}

/// Reads a module's file and those of its children, which lie in `folder`.
fn read_module(file: &Path, folder: &Path, path: Names, modules: &mut BTreeMap<Names, Module>) {
    let text = fs::read_to_string(file).expect("the module's file");
    let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut module = Module {
        items: parsed.items.iter().filter_map(name_of).collect(),
        ..Module::default()
    };
    let mut reader = Reader {
        here: path.clone(),
        inline: 0,
        module: &mut module,
    };
    reader.visit_file(&parsed);
    modules.insert(path.clone(), module);
    for item in &parsed.items {
        let Item::Mod(child) = item else { continue };
        if is_test(child) {
            continue;
        }
        // Generated code has no file.
        let name = child.ident.to_string();
        let inside = folder.join(&name);
        let places: [PathBuf; 2] = [folder.join(format!("{name}.rs")), inside.join("mod.rs")];
        if let Some(file) = places.iter().find(|place| place.is_file()) {
            read_module(file, &inside, [&*path, &[name]].concat(), modules);
        }
    }
}

/// The module that a path leads to, followed through re-exports.
fn home(modules: &BTreeMap<Names, Module>, target: &[String], depth: usize) -> Option<Names> {
    let known = (0..=target.len()).rev().find(|n| modules.contains_key(&target[..*n]))?;
    let (path, rest) = target.split_at(known);
    let module = &modules[path];
    let Some(name) = rest.first() else {
        return Some(path.to_vec());
    };
    if module.items.contains(name) || depth == 0 {
        return Some(path.to_vec());
    }
    let named = module.imports.iter().filter(|(import, _)| import == name);
    let globs = module
        .imports
        .iter()
        .filter(|(import, from)| import == "*" && modules.get(from).is_some_and(|m| m.items.contains(name)));
    match named.chain(globs).next() {
        Some((import, from)) if import == "*" => Some(from.clone()),
        Some((_, from)) => home(modules, from, depth - 1),
        None => Some(path.to_vec()),
    }
}

/// Circles among the siblings of each folder, with an import for each arrow.
fn circles(modules: &BTreeMap<Names, Module>) -> Vec<String> {
    // By folder: from child to child, an example.
    let mut arrows: BTreeMap<Names, BTreeMap<[String; 2], String>> = BTreeMap::new();
    for (path, module) in modules {
        for target in &module.paths {
            let Some(to) = home(modules, target, 8) else {
                continue;
            };
            let shared = path.iter().zip(&to).take_while(|(a, b)| a == b).count();
            let (Some(from), Some(into)) = (path.get(shared), to.get(shared)) else {
                continue;
            };
            let example = format!("{} uses {}", path.join("::"), target.join("::"));
            let folder = arrows.entry(path[..shared].to_vec()).or_default();
            folder.entry([from.clone(), into.clone()]).or_insert(example);
        }
    }
    let mut found = Vec::new();
    for arrows in arrows.values() {
        let graph: DiGraphMap<&str, ()> = arrows.keys().map(|[a, b]| (&**a, &**b)).collect();
        for circle in tarjan_scc(&graph).iter().filter(|circle| circle.len() > 1) {
            let within = |name: &str| circle.contains(&name);
            let inside = arrows.iter().filter(|([a, b], _)| within(a) && within(b));
            let lines: Vec<&str> = inside.map(|(_, example)| &**example).collect();
            found.push(format!("{}:\n    {}", circle.join(", "), lines.join("\n    ")));
        }
    }
    found
}

#[test]
fn no_modules_import_each_other_in_circles() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = Vec::new();
    for [folder, first] in CRATES {
        let modules = modules(&top.join(folder), first);
        assert!(modules.len() > 1, "{folder} has modules");
        found.extend(circles(&modules).iter().map(|circle| format!("{folder}: {circle}")));
    }
    assert!(found.is_empty(), "circles of modules:\n{}", found.join("\n"));
}

/// The first file of a crate that others use is a door: it re-exports what is defined behind it, and nothing behind it
/// uses its own items.
#[test]
fn doors_are_no_rooms() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = Vec::new();
    for folder in ["shared/render/src", "shared/scene/src"] {
        let modules = modules(&top.join(folder), "lib.rs");
        for (path, module) in modules.iter().filter(|(path, _)| !path.is_empty()) {
            // `pub(super)` is a path, too.
            let paths = module.paths.iter().filter(|target| !target.is_empty());
            let up = paths.filter(|target| home(&modules, target, 8).is_some_and(|at| at.is_empty()));
            found.extend(up.map(|target| format!("{folder}: {} uses {}", path.join("::"), target.join("::"))));
        }
    }
    assert!(
        found.is_empty(),
        "what inner modules use of lib.rs:\n{}",
        found.join("\n")
    );
}

/// A circle through a parent's re-export counts.
#[test]
fn circles_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let file = folder.path().join(name);
        fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
        fs::write(file, text).expect("a file");
    };
    write("lib.rs", "mod a;\nmod b;\npub struct Own;\n");
    write("a/mod.rs", "mod deep;\npub use deep::Thing;\n");
    write("a/deep.rs", "use super::super::Own;\npub struct Thing(Own);\n");
    write("b.rs", "pub fn f(_: crate::a::Thing) {}\n");
    assert!(circles(&modules(folder.path(), "lib.rs")).is_empty());
    write("a/deep.rs", "use crate::b::f;\npub struct Thing;\n");
    let found = circles(&modules(folder.path(), "lib.rs"));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("a::deep uses b::f"), "{found:?}");
}

/// `cargo fmt` checks code only.
#[test]
fn comments_are_at_most_120_columns_wide() {
    fn files(folder: &Path, found: &mut Vec<PathBuf>) {
        let entries = fs::read_dir(folder).expect("a folder");
        for entry in entries.map(|entry| entry.expect("an entry").path()) {
            if entry.is_dir() {
                // Generated files have the comments of their source.
                if !entry.ends_with("generated") {
                    files(&entry, found);
                }
            } else if entry.extension().is_some_and(|ending| ending == "rs") {
                found.push(entry);
            }
        }
    }
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = Vec::new();
    for folder in ["coordinator", "proto", "shared", "tests", "worker"] {
        files(&top.join(folder), &mut found);
    }
    let mut wide = Vec::new();
    for file in found {
        let text = fs::read_to_string(&file).expect("a file of text");
        for (line, number) in text.lines().zip(1..) {
            let comment = line.trim_start();
            let is_table = comment.contains("! |") || comment.contains("/ |");
            if comment.starts_with("//") && !is_table && line.chars().count() > 120 {
                wide.push(format!("{}:{number}", file.display()));
            }
        }
    }
    assert!(wide.is_empty(), "comments wider than 120 columns:\n{}", wide.join("\n"));
}

/// Every path of the map in README.md exists; a bare file name stands next to the path of its folder.
#[test]
fn the_map_is_true() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let readme = fs::read_to_string(top.join("README.md")).expect("README.md");
    let (_, map) = readme.split_once("| question | place |").expect("the map");
    let rows = map.lines().skip(2).take_while(|line| line.starts_with('|'));
    let mut seen = 0;
    for row in rows {
        let names = row
            .split('`')
            .skip(1)
            .step_by(2)
            .filter(|name| !name.contains("::") && !name.contains(' '));
        let mut folder = PathBuf::new();
        for name in names {
            let first = name.split('/').next().unwrap_or_default();
            if name.contains('/') && top.join(first).is_dir() {
                let path = top.join(name);
                assert!(path.exists(), "{name}: {row}");
                folder = if path.is_dir() { path } else { path.with_file_name("") };
                seen += 1;
            } else if name.ends_with(".rs") || name.ends_with('/') {
                let mut above = folder.ancestors().take(2);
                assert!(above.any(|folder| folder.join(name).exists()), "{name}: {row}");
            }
        }
    }
    assert!(seen > 25, "{seen}");
}

/// Rows of the table under this heading of a document.
fn rows(document: &str, heading: &str) -> Vec<String> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(document);
    let text = fs::read_to_string(file).expect("a document");
    let (_, table) = text.split_once(heading).expect("the table");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    rows.map(str::to_owned).collect()
}

/// The texts between backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// Files of the program, without tests, that contain a line, by path from the top.
fn sources_with(is: impl Fn(&str) -> bool) -> BTreeSet<String> {
    fn visit(top: &Path, folder: &Path, is: &impl Fn(&str) -> bool, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let ending = path.extension().and_then(|ending| ending.to_str());
            if path.is_dir() {
                if !["tests", "examples", "benches", "generated"]
                    .iter()
                    .any(|not| path.ends_with(not))
                {
                    visit(top, &path, is, found);
                }
            } else if !path.ends_with("tests.rs") && ending.is_some_and(|ending| ["rs", "py", "js"].contains(&ending)) {
                let text = fs::read_to_string(&path).expect("a file of text");
                let lines = text.lines().take_while(|line| line.trim() != "#[cfg(test)]");
                if lines.into_iter().any(is) {
                    let name = path.strip_prefix(top).expect("a path below the top");
                    found.insert(name.to_string_lossy().replace('\\', "/"));
                }
            }
        }
    }
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = BTreeSet::new();
    for folder in ["addons", "coordinator", "proto", "shared", "tests/harness", "worker"] {
        visit(&top, &top.join(folder), &is, &mut found);
    }
    found
}

/// Every step's file exists and contains what the step looks for, and every source that contains the example is a step.
#[test]
fn the_way_of_a_field_is_true() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut named = BTreeSet::new();
    for row in rows("CONTRIBUTING.md", "| the field | file, and what to look for |") {
        let place = row.rsplit(" | ").next().expect("a cell");
        let mut words = quoted(place);
        let file = words.next().expect("a file");
        let text = fs::read_to_string(top.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
        for word in words {
            assert!(text.contains(word), "{file} lacks {word}");
        }
        named.insert(file.to_owned());
    }
    let missing: Vec<String> = sources_with(|line| line.contains("cutoff_angle"))
        .difference(&named)
        .cloned()
        .collect();
    assert!(missing.is_empty(), "no steps of the list: {missing:?}");
}

/// All sources that match on a kind of light, and no others.
#[test]
fn what_knows_lights_is_true() {
    let mut listed: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for row in rows("CONTRIBUTING.md", "| by | folders and files |") {
        let mut words = quoted(&row);
        let files = listed.entry(words.next().expect("a word").to_owned()).or_default();
        let mut folder = "";
        for word in words {
            match word.ends_with('/') {
                true => folder = word,
                false => drop(files.insert(format!("{folder}{word}"))),
            }
        }
    }
    for (word, files) in listed {
        let name = word.trim_matches('"');
        let forms = match word == name {
            true => vec![format!("{name}::"), format!("enum {name}")],
            false => vec![word.clone(), format!("\\\"{name}\\\"")],
        };
        let asks = |line: &str| !line.trim_start().starts_with("use ") && forms.iter().any(|form| line.contains(form));
        assert_eq!(sources_with(asks), files, "{word} in CONTRIBUTING.md");
    }
}

/// Every term names a file that exists.
#[test]
fn the_glossary_is_true() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let rows = rows("docs/method.md", "| term | what it is | where |");
    for row in &rows {
        let file = quoted(row).last().unwrap_or_else(|| panic!("no file: {row}"));
        let places = [top.join(file), top.join("shared/render/src").join(file)];
        assert!(places.iter().any(|place| place.is_file()), "{file}: {row}");
    }
    assert!(rows.len() > 15, "{}", rows.len());
}
