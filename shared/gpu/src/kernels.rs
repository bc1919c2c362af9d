//! The text of all kernels, and the needs that they are compiled for.

/// `quotient` and `root`, used for all divisions and square roots.
pub const ARITHMETIC: &str = include_str!("kernels/arithmetic.wgsl");
/// Workgroups in rows, and the elements that they cover.
pub const GROUPS: &str = include_str!("kernels/groups.wgsl");
/// Exponentials, logarithms, angles; on [`ARITHMETIC`] and [`WIDE`].
pub const MATH: &str = include_str!("kernels/math.wgsl");
/// Powers; on [`MATH`].
pub const POWER: &str = include_str!("kernels/power.wgsl");
/// Random numbers; on [`WIDE`].
pub const SAMPLER: &str = include_str!("kernels/sampler.wgsl");
/// Vectors and frames; on [`ARITHMETIC`].
pub const VECTORS: &str = include_str!("kernels/vectors.wgsl");
/// Distributions; on [`MATH`].
pub const WARP: &str = include_str!("kernels/warp.wgsl");
/// Integers of 64 bits.
pub const WIDE: &str = include_str!("kernels/wide.wgsl");

/// Scattering at surfaces; on [`WARP`], [`VECTORS`] and [`TEXELS`].
pub const BSDF: &str = concat!(
    include_str!("kernels/bsdf.wgsl"),
    include_str!("kernels/microfacet.wgsl"),
    include_str!("kernels/energy.wgsl"),
    include_str!("kernels/rough.wgsl"),
    include_str!("kernels/principled.wgsl"),
    include_str!("kernels/scatter.wgsl"),
    include_str!("kernels/albedo.wgsl"),
    include_str!("kernels/shadowing.wgsl"),
    include_str!("kernels/bending.wgsl"),
);
/// Texture data and tables of rough coats, at binding 39.
pub const TEXELS: &str = include_str!("kernels/texels.wgsl");
/// Phase functions; on [`MATH`] and [`VECTORS`].
pub const PHASE: &str = include_str!("kernels/phase.wgsl");
/// Homogeneous media; on [`PHASE`].
pub const MEDIUM: &str = include_str!("kernels/medium.wgsl");
/// Varying densities, from binding 55.
pub const VOLUMES: &str = include_str!("kernels/volumes.wgsl");
/// Walks through them; on [`VOLUMES`], [`SAMPLER`] and [`WORLD`].
pub const WALK: &str = include_str!("kernels/walk.wgsl");
/// How much of a beam's light reaches a segment; on [`VOLUMES`], before [`ESTIMATE`].
pub const ATTENUATION: &str = include_str!("kernels/attenuation.wgsl");
/// Where photon paths store the transmittance along their beams; on [`WALK`].
const BEAM_STEPS: &str = include_str!("kernels/beam_steps.wgsl");

/// What paths find of light with a wavelength; on [`PHOTON_REQUEST`] or [`ESTIMATE`].
pub const WAVES: &str = include_str!("kernels/waves.wgsl");

/// Its replacement for scenes without dispersion.
const NO_WAVES: &str = include_str!("kernels/no_waves.wgsl");

/// Texts for varying densities, and their replacements for scenes without: kernels of such scenes contain nothing of
/// the kind.
const EVEN: [[&str; 2]; 4] = [
    [VOLUMES, include_str!("kernels/even.wgsl")],
    [WALK, include_str!("kernels/even_walk.wgsl")],
    [ATTENUATION, include_str!("kernels/even_attenuation.wgsl")],
    [BEAM_STEPS, include_str!("kernels/no_beam_steps.wgsl")],
];

/// Camera rays; on [`WARP`] and [`VECTORS`].
pub const CAMERA: &str = include_str!("kernels/camera.wgsl");
/// Where photons start; on [`WARP`], [`VECTORS`] and [`TEXTURE`]. Triangles of emitting surfaces are at binding 28,
/// sampling tables of lights at binding 32.
pub const EMISSION: &str = concat!(
    include_str!("kernels/light_tables.wgsl"),
    include_str!("kernels/environment.wgsl"),
    include_str!("kernels/projector.wgsl"),
    include_str!("kernels/emission.wgsl"),
);

/// A scene by its numbers; on [`BSDF`], [`EMISSION`], [`MEDIUM`] and [`CAMERA`]. For programs with the buffers of
/// [`WorldBuffers`](crate::world::WorldBuffers), from binding 25.
pub const WORLD: &str = include_str!("kernels/world.wgsl");

/// Light at a point: which light, where on it, and with what density; on [`SAMPLER`] and [`WORLD`]. For programs with
/// the buffers of [`ChoiceBuffers`](crate::world::choice::ChoiceBuffers), from binding 31.
pub const DIRECT: &str = concat!(
    include_str!("kernels/choice.wgsl"),
    include_str!("kernels/rectangle.wgsl"),
    include_str!("kernels/direct.wgsl")
);

/// A scene's geometry and ray queries, described in `kernels/rays.wgsl`. After arithmetic, vectors and wide integers,
/// for programs with the buffers of [`GeometryBuffers`](crate::world::geometry::GeometryBuffers), from binding 20.
pub const RAYS: &str = concat!(
    include_str!("kernels/geometry.wgsl"),
    include_str!("kernels/products.wgsl"),
    include_str!("kernels/triangles.wgsl"),
    include_str!("kernels/rounds.wgsl"),
    include_str!("kernels/slivers.wgsl"),
    include_str!("kernels/rays.wgsl"),
);

/// Photons aimed at discs; on [`DIRECT`] and [`RAYS`], for programs that also have the buffers of
/// [`AimBuffers`](crate::world::aims::AimBuffers), from binding 60.
pub const AIM: &str = include_str!("kernels/aim.wgsl");

/// Its replacement where no photons are aimed.
const NO_AIM: &str = include_str!("kernels/no_aim.wgsl");

/// Photon footprints: the share of the light that a photon stands for; on [`VECTORS`] and [`RAYS`].
pub const FOOTPRINT: &str = include_str!("kernels/footprint.wgsl");

/// Values over surfaces; on [`TEXELS`], for programs that also have the buffers of
/// [`TextureBuffers`](crate::world::textures::TextureBuffers), from binding 38.
pub const TEXTURE: &str = include_str!("kernels/texture.wgsl");

/// From a ray's hit to a point on a surface and its material, described in `kernels/surface.wgsl` and
/// `kernels/interaction.wgsl`. On [`MATH`], [`SAMPLER`], [`RAYS`], [`TEXTURE`] and [`WORLD`], for programs that also
/// have the buffers of [`ShapeBuffers`](crate::world::shapes::ShapeBuffers), from binding 35.
pub const SURFACE: &str = concat!(
    include_str!("kernels/surface.wgsl"),
    include_str!("kernels/interaction.wgsl"),
);

/// Shadow rays; on [`DIRECT`], [`SURFACE`] and [`WALK`].
pub const SHADOW: &str = include_str!("kernels/shadow.wgsl");

/// Single scattering in a medium, on a segment of a ray; on [`SHADOW`].
pub const SEGMENT: &str = include_str!("kernels/segment.wgsl");

/// For [`Needs::surfaces`]: textures use vertex colours.
pub const NEEDS_COLORS: u32 = 1 << 19;

/// The properties of a scene that its kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Needs {
    /// Stack entries of a ray: [`Sizes::stack_entries`](crate::world::geometry::Sizes::stack_entries).
    pub stack: u32,
    /// Kinds of its surfaces, as bits: [`FlatMaterials::needs`](crate::world::materials::FlatMaterials::needs).
    pub surfaces: u32,
    /// Some medium's density varies.
    pub varies: bool,
    /// Some surface refracts each wavelength by a different angle.
    pub disperses: bool,
    /// Photons of some light are aimed.
    pub aims: bool,
    /// Groups of lights have layers.
    pub light_groups: bool,
}

impl Needs {
    /// More than most scenes need, but without varying densities, dispersion, aimed photons, layers of light groups, or
    /// vertex colours.
    pub const ALL: Self = Self {
        stack: 64,
        surfaces: !NEEDS_COLORS,
        varies: false,
        disperses: false,
        aims: false,
        light_groups: false,
    };
}

/// Which of a device's own operations are exact and therefore used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Arithmetic {
    /// Its division.
    pub native_quotient: bool,
    /// Its square root.
    pub native_root: bool,
}

impl Arithmetic {
    /// The two functions that [`ARITHMETIC`] leaves open.
    fn text(self) -> String {
        let whose = |is_native| if is_native { "native" } else { "own" };
        let (quotient, root) = (whose(self.native_quotient), whose(self.native_root));
        format!(
            "\nfn quotient(a: f32, b: f32) -> f32 {{ return {quotient}_quotient(a, b); }}\n\
             fn root(x: f32) -> f32 {{ return {root}_root(x); }}\n"
        )
    }
}

/// A kernel's text: its includes, and finally itself.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    /// Its name in errors.
    pub name: &'static str,
    /// Texts in dependency order.
    pub texts: &'static [&'static str],
}

impl Program {
    /// The whole text, for a device with this arithmetic and the needs of most scenes.
    #[must_use]
    pub fn source(&self, arithmetic: Arithmetic) -> String {
        self.source_for(arithmetic, Needs::ALL)
    }

    /// The same for the needs of a scene.
    #[must_use]
    pub fn source_for(&self, arithmetic: Arithmetic, needs: Needs) -> String {
        let Needs {
            stack,
            surfaces,
            varies,
            disperses,
            aims,
            light_groups,
        } = needs;
        let mut source = format!(
            "const STACK = {stack}u;\nconst SURFACES = {surfaces}u;\nconst DISPERSES = {disperses};\n\
             const HAS_LIGHT_GROUPS = {light_groups};\n"
        );
        for text in self.texts {
            let even = EVEN.iter().find(|[varying, _]| !varies && varying == text);
            source.push('\n');
            source.push_str(match *text {
                WAVES if !disperses => NO_WAVES,
                AIM if !aims => NO_AIM,
                text => even.map_or(text, |[_, even]| even),
            });
            if *text == ARITHMETIC {
                source.push_str(&arithmetic.text());
            }
        }
        source
    }
}

/// The device self-test.
pub const SELF_TEST: Program = Program {
    name: "self_test",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        MATH,
        POWER,
        include_str!("kernels/self_test.wgsl"),
    ],
};

/// Sums over a workgroup.
const SUMS: &str = include_str!("kernels/sums.wgsl");

/// Prefix sums.
pub const SCAN: Program = Program {
    name: "scan",
    texts: &[GROUPS, SUMS, include_str!("kernels/scan.wgsl")],
};

/// The number of workgroups.
pub const SIZES: Program = Program {
    name: "sizes",
    texts: &[GROUPS, include_str!("kernels/sizes.wgsl")],
};

/// One step of a sort.
pub const SORT: Program = Program {
    name: "sort",
    texts: &[GROUPS, SUMS, include_str!("kernels/sort.wgsl")],
};

/// Splits two-word keys for two sorts by one word.
pub const SORT_WIDE: Program = Program {
    name: "sort_wide",
    texts: &[GROUPS, include_str!("kernels/sort_wide.wgsl")],
};

/// Positions of boxes along a curve.
pub const ORDER: Program = Program {
    name: "order",
    texts: &[ARITHMETIC, GROUPS, include_str!("kernels/order.wgsl")],
};

/// Boxes around boxes.
pub const TREE: Program = Program {
    name: "tree",
    texts: &[GROUPS, include_str!("kernels/tree.wgsl")],
};

/// Photon beams and pieces of them.
pub const BEAM: &str = include_str!("kernels/beam.wgsl");

/// The box around a scene; on [`RAYS`]. Its buffer is at binding 51.
pub const HULL: &str = include_str!("kernels/hull.wgsl");
/// Whether walls occlude light; on [`RAYS`].
pub const SHADE: &str = include_str!("kernels/shade.wgsl");
/// Walls near segments; on [`SHADE`]. Its buffer is at binding 50.
pub const NEAR: &str = include_str!("kernels/near.wgsl");
/// Walls that cross the kernels of photons on surfaces; on [`NEAR`] and [`HULL`].
pub const CROSSING: &str = include_str!("kernels/crossing.wgsl");
/// Planes of walls near beams; on [`BEAM`]. Its buffer is at binding 52.
pub const PLANES: &str = include_str!("kernels/planes.wgsl");
/// Which points see a beam past walls; on [`HULL`], [`PLANES`] and [`SHADE`], before [`ESTIMATE`]. The beams are at
/// binding 53.
pub const HIDDEN: &str = include_str!("kernels/hidden.wgsl");
/// Replaces [`HIDDEN`]: all points do.
pub const OPEN: &str = include_str!("kernels/open.wgsl");

/// A piece's contribution to a segment; on [`MATH`], [`VECTORS`], [`SAMPLER`], [`BEAM`], and [`HIDDEN`] or [`OPEN`].
pub const ESTIMATE: &str = include_str!("kernels/estimate.wgsl");

/// Surface photons.
pub const PHOTON: &str = include_str!("kernels/photon.wgsl");

/// Requests to the photon map, and their MIS weights against paths; on [`BSDF`].
pub const PHOTON_REQUEST: &str = include_str!("kernels/photon_request.wgsl");

/// Boxes around photon kernels.
pub const PHOTON_MAP: Program = Program {
    name: "photon_map",
    texts: &[GROUPS, PHOTON, include_str!("kernels/photon_map.wgsl")],
};

/// The sum of photon contributions at each point.
pub const PHOTONS: Program = Program {
    name: "photons",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        MATH,
        WARP,
        VECTORS,
        TEXELS,
        BSDF,
        RAYS,
        SHADE,
        PHOTON,
        PHOTON_REQUEST,
        WAVES,
        include_str!("kernels/photons.wgsl"),
    ],
};

/// Cuts beams into pieces.
pub const PIECES: Program = Program {
    name: "pieces",
    texts: &[ARITHMETIC, GROUPS, BEAM, PLANES, include_str!("kernels/pieces.wgsl")],
};

/// Finds the walls near each beam.
pub const WALLS: Program = Program {
    name: "walls",
    texts: &[
        ARITHMETIC,
        GROUPS,
        VECTORS,
        WIDE,
        RAYS,
        SHADE,
        NEAR,
        HULL,
        BEAM,
        PLANES,
        include_str!("kernels/walls.wgsl"),
    ],
};

/// The sum of the pieces' contributions to each segment, in a scene without walls.
pub const GATHER: Program = Program {
    name: "gather",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        MATH,
        VECTORS,
        SAMPLER,
        BEAM,
        OPEN,
        VOLUMES,
        ATTENUATION,
        ESTIMATE,
        WAVES,
        include_str!("kernels/gather.wgsl"),
        include_str!("kernels/tile.wgsl"),
    ],
};

/// The same with walls that may hide beams.
pub const GATHER_WALLED: Program = Program {
    name: "gather_walled",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        MATH,
        VECTORS,
        SAMPLER,
        RAYS,
        SHADE,
        HULL,
        BEAM,
        PLANES,
        HIDDEN,
        VOLUMES,
        ATTENUATION,
        ESTIMATE,
        WAVES,
        include_str!("kernels/gather.wgsl"),
        include_str!("kernels/tile.wgsl"),
    ],
};

/// Photon paths.
pub const TRACE: Program = Program {
    name: "trace",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        MATH,
        SAMPLER,
        WARP,
        VECTORS,
        TEXELS,
        BSDF,
        PHASE,
        MEDIUM,
        CAMERA,
        TEXTURE,
        EMISSION,
        WORLD,
        VOLUMES,
        WALK,
        BEAM_STEPS,
        DIRECT,
        RAYS,
        SURFACE,
        SHADE,
        BEAM,
        PHOTON,
        AIM,
        include_str!("kernels/trace_plan.wgsl"),
        FOOTPRINT,
        include_str!("kernels/edges.wgsl"),
        include_str!("kernels/photon_path.wgsl"),
        include_str!("kernels/trace.wgsl"),
    ],
};

/// Finds the walls that cross photon kernels.
pub const PHOTON_WALLS: Program = Program {
    name: "photon_walls",
    texts: &[
        ARITHMETIC,
        GROUPS,
        VECTORS,
        WIDE,
        RAYS,
        SHADE,
        NEAR,
        HULL,
        CROSSING,
        PHOTON,
        include_str!("kernels/photon_walls.wgsl"),
    ],
};

/// A kernel of camera paths, with access to the whole scene.
macro_rules! of_paths {
    ($name:literal, $file:literal $(, $more:expr)?) => {
        Program {
            name: $name,
            texts: &[
                ARITHMETIC,
                GROUPS,
                WIDE,
                MATH,
                SAMPLER,
                WARP,
                VECTORS,
                TEXELS,
                BSDF,
                PHASE,
                MEDIUM,
                CAMERA,
                TEXTURE,
                EMISSION,
                WORLD,
                VOLUMES,
                WALK,
                RAYS,
                SURFACE,
                DIRECT,
                SHADOW,
                SEGMENT,
                PHOTON_REQUEST,
                PATH,
                $($more,)?
                include_str!($file),
            ],
        }
    };
}

/// Camera paths.
pub const PATH: &str = include_str!("kernels/path.wgsl");

/// How they account for the light of groups; on [`PATH`].
const LIGHT_GROUPS: &str = include_str!("kernels/light_groups.wgsl");

/// Starts camera paths.
pub const PATH_START: Program = of_paths!("path_start", "kernels/path_start.wgsl");

/// The first surface that each camera path meets.
pub const PATH_FIRST: Program = of_paths!("path_first", "kernels/path_first.wgsl");

/// What the paths' rays meet.
pub const PATH_MEET: Program = of_paths!("path_meet", "kernels/path_meet.wgsl");

/// How paths cross media of varying density.
pub const PATH_CROSS: Program = of_paths!("path_cross", "kernels/path_cross.wgsl");

/// How paths continue from there.
pub const PATH_STEP: Program = of_paths!("path_step", "kernels/path_step.wgsl", LIGHT_GROUPS);

/// Direct light on paths.
pub const PATH_LIT: Program = of_paths!("path_lit", "kernels/path_lit.wgsl", LIGHT_GROUPS);

/// Single scattering towards paths.
pub const PATH_FOG: Program = of_paths!("path_fog", "kernels/path_fog.wgsl", LIGHT_GROUPS);

/// Which paths continue.
pub const PATH_PACK: Program = of_paths!("path_pack", "kernels/path_pack.wgsl");

/// Adds the gathered light to paths.
pub const PATH_ADD: Program = of_paths!("path_add", "kernels/path_add.wgsl", LIGHT_GROUPS);

/// The film.
pub const PATH_FILM: Program = of_paths!("path_film", "kernels/path_film.wgsl");

/// All programs.
pub const ALL: &[Program] = &[
    SELF_TEST,
    SCAN,
    SIZES,
    SORT,
    SORT_WIDE,
    ORDER,
    TREE,
    PIECES,
    GATHER,
    TRACE,
    PHOTON_WALLS,
    PHOTON_MAP,
    PHOTONS,
    PATH_START,
    PATH_FIRST,
    PATH_MEET,
    PATH_CROSS,
    PATH_STEP,
    PATH_LIT,
    PATH_FOG,
    PATH_ADD,
    PATH_PACK,
    PATH_FILM,
    WALLS,
    GATHER_WALLED,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{MOST_BUFFERS, MOST_SHARED, MOST_THREADS};
    use crate::spirv;

    #[test]
    fn all_kernels_keep_the_rules_and_compile() {
        let (mut buffers, mut threads) = (0, 0);
        for program in ALL {
            for native in [false, true] {
                let arithmetic = Arithmetic {
                    native_quotient: native,
                    native_root: !native,
                };
                let needs = Needs {
                    varies: native,
                    disperses: native,
                    aims: native,
                    light_groups: native,
                    surfaces: if native { u32::MAX } else { Needs::ALL.surfaces },
                    ..Needs::ALL
                };
                let checked = spirv::check(program.name, &program.source_for(arithmetic, needs)).unwrap();
                for entry in &checked.module.entry_points {
                    let compiled = checked.compile(&entry.name, spirv::Controls::default()).unwrap();
                    buffers = buffers.max(compiled.bindings.len() as u32);
                    threads = threads.max(compiled.workgroup.iter().product());
                    assert!(shared_bytes(&checked.module) <= MOST_SHARED, "{}", program.name);
                }
            }
        }
        assert_eq!((buffers, threads), (MOST_BUFFERS, MOST_THREADS));
    }

    /// Bytes of all variables that workgroups share.
    fn shared_bytes(module: &naga::Module) -> u32 {
        let shared = module.global_variables.iter().map(|(_, variable)| variable);
        let shared = shared.filter(|variable| variable.space == naga::AddressSpace::WorkGroup);
        shared
            .map(|variable| module.types[variable.ty].inner.size(module.to_ctx()))
            .sum()
    }

    /// No two texts use the same name for different things.
    #[test]
    fn a_kernel_may_have_all_texts() {
        let all = Program {
            name: "all",
            texts: &[
                ARITHMETIC,
                GROUPS,
                WIDE,
                MATH,
                POWER,
                SAMPLER,
                WARP,
                VECTORS,
                TEXELS,
                BSDF,
                PHASE,
                MEDIUM,
                CAMERA,
                TEXTURE,
                EMISSION,
                WORLD,
                VOLUMES,
                WALK,
                DIRECT,
                RAYS,
                AIM,
                FOOTPRINT,
                PHOTON,
                SURFACE,
                SHADE,
                SHADOW,
                SEGMENT,
                PHOTON_REQUEST,
                NEAR,
                HULL,
                CROSSING,
                BEAM,
                PLANES,
                HIDDEN,
                ATTENUATION,
                ESTIMATE,
            ],
        };
        for varies in [false, true] {
            let needs = Needs {
                varies,
                aims: varies,
                ..Needs::ALL
            };
            spirv::check(all.name, &all.source_for(Arithmetic::default(), needs)).unwrap();
        }
    }
}
