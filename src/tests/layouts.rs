//! Rust and WGSL must agree about what they share: the fields of structs, and constants.

use bevy::reflect::{TypeInfo, Typed};
use naga::{Expression, Literal, Module, TypeInner, front::wgsl::parse_str};

/// Asserts that a struct of a shader has the fields of a uniform, by name and offset: `assert_layout!(Uniform,
/// "shader", "Struct")`.
macro_rules! assert_layout {
    ($uniform:ty, $shader:literal, $name:literal) => {
        $crate::tests::layouts::assert_fields::<$uniform>(
            &<$uniform as bevy::render::render_resource::ShaderType>::METADATA.extra.offsets,
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $shader, ".wgsl")),
            $name,
        )
    };
}
pub(crate) use assert_layout;

/// Asserts that the struct `name` of a shader has the fields of `T` at these offsets.
pub(crate) fn assert_fields<T: Typed>(offsets: &[u64], shader: &str, name: &str) {
    let TypeInfo::Struct(uniform) = T::type_info() else { panic!("{} is no struct", T::type_path()) };
    let expected: Vec<_> = uniform.field_names().iter().map(|name| name.to_string()).zip(offsets.to_vec()).collect();
    // It may contain others.
    let structs = shader.split("\nstruct ").skip(1).filter_map(|text| text.split_once("\n}"));
    let module = parse(&structs.map(|(members, _)| format!("struct {members}\n}}\n")).collect::<String>());
    let found =
        module.types.iter().find(|(_, found)| found.name.as_deref() == Some(name)).map(|(_, found)| &found.inner);
    let Some(TypeInner::Struct { members, .. }) = found else { panic!("{name} is no struct") };
    let found: Vec<_> =
        members.iter().map(|member| (member.name.clone().unwrap_or_default(), u64::from(member.offset))).collect();
    assert_eq!(found, expected, "{name}");
}

/// Returns the value of a constant of a shader.
pub(crate) fn constant(module: &Module, name: &str) -> Option<Literal> {
    let (_, constant) = module.constants.iter().find(|(_, constant)| constant.name.as_deref() == Some(name))?;
    match module.global_expressions[constant.init] {
        Expression::Literal(literal) => Some(literal),
        _ => None,
    }
}

/// Parses a shader that imports nothing.
pub(crate) fn parse(shader: &str) -> Module {
    parse_str(shader).unwrap_or_else(|error| panic!("{}", error.emit_to_string(shader)))
}
