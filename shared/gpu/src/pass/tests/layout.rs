//! Structs have the kernels' memory layout.

use crate::kernels::{PATH_FILM, PATH_START, PATH_STEP};
use crate::pass::constants::{PassConstants, Use};
use crate::pass::paths::{Branch, Found, Path, SIZES};
use crate::testing::{layout, same_layout};

#[test]
fn paths_lie_in_memory_as_kernels_have_them() {
    same_layout!(
        &PATH_START,
        Path {
            origin,
            medium,
            dir,
            phase,
            beta,
            depth,
            track,
            flags,
            point,
            density,
            facing,
            projected,
            share,
            rest,
            splits,
            distance,
            behind,
            x,
            y,
            surface
        }
    );
    same_layout!(
        &PATH_FILM,
        Found {
            direct,
            rays,
            surface,
            beams,
            volume,
            let_through
        }
    );
    same_layout!(
        &PATH_START,
        PassConstants {
            camera_stream,
            lens_stream,
            offset,
            has_offset,
            by_parts,
            in_kernel,
            least_flight,
            patience,
            photons_go_on,
            ends,
            leave_beams,
            first,
            slots,
            columns,
            unmet_caustics,
            on_gloss,
            waves,
            splits,
            branches,
            chord_key,
            weights,
            etas,
            records
        }
    );
    same_layout!(
        &PATH_STEP,
        Branch {
            origin,
            medium,
            dir,
            depth,
            beta,
            flags,
            track,
            surface,
            share,
            rest
        }
    );
    same_layout!(
        &PATH_STEP,
        Use {
            way,
            in_caustic,
            light_group
        }
    );
    for (name, bytes) in SIZES {
        assert_eq!(u64::from(layout(&PATH_STEP, name).0), bytes, "{name}");
    }
}
