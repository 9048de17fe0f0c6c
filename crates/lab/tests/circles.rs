//! Files of a crate do not import each other in circles.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fs,
    path::{Path, PathBuf},
};

/// A path of modules from the root of a crate.
type Module = Vec<String>;

/// A file, without comments and tests.
struct Source {
    file: String,
    tokens: Vec<String>,
}

/// The number of folders in folders.
const DEEPEST: usize = 4;

/// The files of a crate by module.
struct Crate(BTreeMap<Module, Source>);

/// The paths that a module names: as `use` declarations, with whether they are exported and under which name, and in
/// code.
#[derive(Default)]
struct Paths {
    exported: Vec<(String, Vec<String>)>,
    used: Vec<Vec<String>>,
}

impl Crate {
    fn read(folder: &Path, root: &Path) -> Self {
        let mut files = BTreeMap::new();
        let mut folders = vec![(folder.to_path_buf(), Module::new())];
        while let Some((folder, module)) = folders.pop() {
            for entry in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
                let name = entry.file_stem().unwrap().to_str().unwrap().to_owned();
                if name == "tests" {
                    continue;
                }
                let mut inner = module.clone();
                if entry.is_dir() {
                    inner.push(name);
                    folders.push((entry, inner));
                } else if entry.extension().is_some_and(|extension| extension == "rs") {
                    // A program beside a library is a crate of its own.
                    if name == "main" && folder.join("lib.rs").exists() {
                        continue;
                    }
                    if !["lib", "main", "mod"].contains(&name.as_str()) {
                        inner.push(name);
                    }
                    let file = entry.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
                    files.insert(inner, Source { file, tokens: tokens(&fs::read_to_string(&entry).unwrap()) });
                }
            }
        }
        Self(files)
    }

    /// Returns the module that a path in `from` leads to: the file that defines what it names.
    fn resolve(&self, from: &Module, path: &[String], paths: &HashMap<&Module, Paths>, depth: u32) -> Option<Module> {
        let mut rest = path;
        let mut at = match rest.first()?.as_str() {
            "crate" => Module::new(),
            "self" => from.clone(),
            "super" => from[..from.len().checked_sub(1)?].to_vec(),
            child => {
                let inner: Module = from.iter().cloned().chain([child.to_owned()]).collect();
                self.0.contains_key(&inner).then_some(inner)?
            }
        };
        rest = &rest[1..];
        while let Some(name) = rest.first() {
            rest = &rest[1..];
            if name == "super" {
                at.pop();
                continue;
            }
            at.push(name.clone());
            if self.0.contains_key(&at) {
                continue;
            }
            at.pop();
            let exported = paths.get(&at)?.exported.iter().find(|(known, _)| known == name);
            return match exported {
                Some((_, path)) if depth > 0 => self.resolve(&at, path, paths, depth - 1).or(Some(at)),
                _ => Some(at),
            };
        }
        Some(at)
    }

    /// Returns what each module needs that is so deep in the crate: a file, or a folder with all that it contains.
    fn modules<'a>(edges: &BTreeMap<&'a str, BTreeSet<&'a str>>, depth: usize) -> BTreeMap<&'a str, BTreeSet<&'a str>> {
        let module = |file: &'a str| {
            let inner = file.find("src/").unwrap() + "src/".len();
            file[inner..].match_indices('/').nth(depth).map_or(file, |(end, _)| &file[..inner + end + 1])
        };
        let mut modules: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for (file, needs) in edges {
            let needs = needs.iter().map(|file| module(file)).filter(|other| *other != module(file));
            modules.entry(module(file)).or_default().extend(needs);
        }
        modules
    }

    /// Returns the files that each file needs.
    fn files(&self) -> BTreeMap<&str, BTreeSet<&str>> {
        let paths: HashMap<&Module, Paths> = self.0.iter().map(|(module, source)| (module, source.paths())).collect();
        let needs = |module: &Module, source: &Source| {
            let Paths { exported, used } = &paths[module];
            let all = used.iter().chain(exported.iter().map(|(_, path)| path));
            let targets = all.filter_map(|path| self.resolve(module, path, &paths, 8));
            let files = targets.filter_map(|target| Some(self.0.get(&target)?.file.as_str()));
            files.filter(|file| *file != source.file).collect()
        };
        self.0.iter().map(|(module, source)| (source.file.as_str(), needs(module, source))).collect()
    }
}

/// Splits code into words and marks. Leaves out comments, literals, and everything from the tests on.
fn tokens(code: &str) -> Vec<String> {
    let tests = ["#[cfg(test)]\nmod ", "#[cfg(all(test"].iter().filter_map(|tests| code.find(tests)).min();
    let code = &code[..tests.unwrap_or(code.len())];
    let mut tokens = Vec::new();
    let mut rest = code;
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if first == '"' {
            let mut end = 1;
            let bytes = rest.as_bytes();
            while end < bytes.len() && bytes[end] != b'"' {
                end += if bytes[end] == b'\\' { 2 } else { 1 };
            }
            (end + 1).min(rest.len())
        } else if first.is_alphanumeric() || first == '_' {
            let length = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            tokens.push(rest[..length].to_owned());
            length
        } else if rest.starts_with("::") {
            tokens.push("::".to_owned());
            2
        } else {
            if !first.is_whitespace() {
                tokens.push(first.to_string());
            }
            first.len_utf8()
        };
        rest = &rest[length..];
    }
    tokens
}

impl Source {
    fn paths(&self) -> Paths {
        let mut paths = Paths::default();
        let mut at = 0;
        let token = |at: usize| self.tokens.get(at).map_or("", String::as_str);
        while at < self.tokens.len() {
            if token(at) == "use" {
                let exported = at > 0 && ["pub", ")"].contains(&token(at - 1));
                let mut found = Vec::new();
                at = self.tree(at + 1, &[], &mut found);
                for (name, path) in found {
                    if exported {
                        paths.exported.push((name, path));
                    } else {
                        paths.used.push(path);
                    }
                }
            } else if ["crate", "super", "self"].contains(&token(at)) && token(at + 1) == "::" {
                // `pub(in crate::module)`
                let is_visibility = at > 0 && token(at - 1) == "in";
                let mut path = vec![token(at).to_owned()];
                while token(at + 1) == "::" && token(at + 2).starts_with(|c: char| c.is_alphabetic() || c == '_') {
                    path.push(token(at + 2).to_owned());
                    at += 2;
                }
                if !is_visibility {
                    paths.used.push(path);
                }
            }
            at += 1;
        }
        paths
    }

    /// Reads the tree of a `use` declaration, and returns the index after it.
    fn tree(&self, mut at: usize, before: &[String], found: &mut Vec<(String, Vec<String>)>) -> usize {
        let mut path = before.to_vec();
        while let Some(token) = self.tokens.get(at) {
            match token.as_str() {
                "{" => {
                    at += 1;
                    while self.tokens.get(at).is_some_and(|token| token != "}") {
                        at = self.tree(at, &path, found);
                        if self.tokens.get(at).is_some_and(|token| token == ",") {
                            at += 1;
                        }
                    }
                    return at + 1;
                }
                "::" => at += 1,
                "as" => {
                    found.push((self.tokens[at + 1].clone(), path));
                    return at + 2;
                }
                "," | "}" | ";" => break,
                name => {
                    path.push(name.to_owned());
                    at += 1;
                }
            }
        }
        found.push((path.last().cloned().unwrap_or_default(), path));
        at
    }
}

/// Returns the circles: sets of files that all need each other, directly or not.
fn circles<'a>(edges: &BTreeMap<&'a str, BTreeSet<&'a str>>) -> BTreeSet<BTreeSet<&'a str>> {
    let below = |file: &'a str| {
        let (mut reached, mut stack) = (BTreeSet::new(), vec![file]);
        while let Some(next) = stack.pop() {
            stack.extend(edges[next].iter().copied().filter(|file| reached.insert(*file)));
        }
        reached
    };
    let below: BTreeMap<&str, BTreeSet<&str>> = edges.keys().map(|file| (*file, below(file))).collect();
    let circle = |file: &&'a str| below[file].iter().copied().filter(|other| below[other].contains(file)).collect();
    edges.keys().filter(|file| below[*file].contains(*file)).map(circle).collect()
}

#[test]
fn files_import_each_other_in_no_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    let crates = fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path().join("src"));
    let folders: Vec<PathBuf> = crates.chain([root.join("src")]).filter(|folder| folder.exists()).collect();
    let mut report = String::new();
    for folder in folders {
        let sources = Crate::read(&folder, &root);
        let files = sources.files();
        for edges in [files.clone()].into_iter().chain((0..DEEPEST).map(|depth| Crate::modules(&files, depth))) {
            for circle in circles(&edges) {
                for file in &circle {
                    let needs: Vec<_> = edges[*file].intersection(&circle).collect();
                    report += &format!("{file} needs {needs:?}\n");
                }
                report += "\n";
            }
        }
    }
    assert!(report.is_empty(), "circles:\n{report}");
}
