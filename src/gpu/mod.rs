//! The graphics device. This module opens it, composes shaders for it, and moves data to and from it.
//! Only [`crate::render`] and the GPU matrix of [`crate::transport`] use these types.

pub(crate) mod buffers;
pub(crate) mod device;
mod fold;
mod kept;
mod lent;
pub(crate) mod pipeline;
pub mod shader;
mod stopwatch;

pub use device::AdapterSummary;
pub(crate) use device::Gpu;
pub(crate) use lent::Lent;

#[cfg(test)]
impl Gpu {
    pub(crate) fn for_tests() -> Self {
        Self::open(None, 0).expect("the README's test command installs a Vulkan driver")
    }
}

/// Assertions for tests that shaders and host agree on the layouts of structures and on constants.
#[cfg(test)]
pub(crate) mod layout {
    /// Asserts that the WGSL struct `name` of shader `shader` has exactly these members, offsets and size.
    pub(crate) fn assert_members(shader: &str, name: &str, members: &[(&str, usize)], size: usize) {
        let module = super::shader::module(shader).unwrap_or_else(|e| unreachable!("{e}"));
        let found = module.types.iter().find_map(|(_, ty)| match &ty.inner {
            naga::TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => {
                Some((members, *span))
            }
            _ => None,
        });
        let (wgsl, span) = found.unwrap_or_else(|| unreachable!("{shader} has no struct {name}"));
        let wgsl: Vec<_> =
            wgsl.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize)).collect();
        let host: Vec<_> = members.iter().map(|(name, offset)| ((*name).to_owned(), *offset)).collect();
        assert_eq!(host, wgsl, "members of {name}");
        assert_eq!(size, span as usize, "size of {name}");
    }

    /// Asserts that the WGSL constant `name` of shader `shader` has this value.
    pub(crate) fn assert_constant(shader: &str, name: &str, value: u32) {
        let module = super::shader::module(shader).unwrap_or_else(|e| unreachable!("{e}"));
        let found = module.constants.iter().find(|(_, constant)| constant.name.as_deref() == Some(name));
        let (_, constant) = found.unwrap_or_else(|| unreachable!("{shader} has no constant {name}"));
        let wgsl = &module.global_expressions[constant.init];
        assert!(
            matches!(wgsl, naga::Expression::Literal(naga::Literal::U32(wgsl)) if *wgsl == value),
            "{name} is {wgsl:?} in WGSL, {value} here"
        );
    }

    /// Asserts that a WGSL struct of a shader has exactly the members, offsets and size of a type.
    macro_rules! assert_layout {
        ($shader:literal, $name:literal, $ty:ty: $($member:ident),* $(,)?) => {
            $crate::gpu::layout::assert_members(
                $shader,
                $name,
                &[$((stringify!($member), std::mem::offset_of!($ty, $member))),*],
                size_of::<$ty>(),
            )
        };
    }
    pub(crate) use assert_layout;
}
