use super::*;
use glam::{DAffine3, DQuat, DVec2, EulerRot};

fn cube_at(center: DVec3, half: f64) -> RawMesh {
    let mut cube = RawMesh::cube();
    cube.positions.iter_mut().for_each(|p| *p = center + half * *p);
    cube
}

fn turned_inside_out(mut mesh: RawMesh) -> RawMesh {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

fn joined(meshes: &[RawMesh]) -> RawMesh {
    let mut all = RawMesh::default();
    for mesh in meshes {
        let first = all.positions.len() as u32;
        all.positions.extend(&mesh.positions);
        all.triangles
            .extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

/// Six times the volume.
fn volume(mesh: &RawMesh) -> f64 {
    let of_face = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        a.dot(b.cross(c))
    };
    mesh.triangles.iter().map(of_face).sum()
}

fn mended(mesh: &RawMesh, doubled: usize, turned: usize) -> RawMesh {
    let solid = mesh.solid().unwrap();
    assert_eq!((solid.doubled, solid.turned), (doubled, turned));
    solid.mended.unwrap_or_else(|| mesh.clone())
}

#[test]
fn what_can_be_one_solid_only_becomes_it() {
    let cube = cube_at(DVec3::new(7.0, -3.0, 2.0), 1.0);
    let is_the_cube = |mesh: &RawMesh| assert!((volume(mesh) - 48.0).abs() < 1e-9, "{}", volume(mesh));
    assert_eq!(mended(&cube, 0, 0), cube);
    is_the_cube(&mended(&turned_inside_out(cube.clone()), 0, 12));
    for faces in [vec![3], vec![0, 1, 2, 8], (0..11).collect()] {
        let mut mixed = cube.clone();
        faces.iter().for_each(|f: &usize| mixed.triangles[*f].swap(1, 2));
        is_the_cube(&mended(&mixed, 0, faces.len()));
        // And a face that is there twice, once in each direction.
        let [a, b, c] = mixed.triangles[5];
        mixed.triangles.push([b, a, c]);
        mixed.triangles.push([c, a, b]);
        is_the_cube(&mended(&mixed, 2, faces.len()));
    }
    // The whole mesh doubled, in either direction.
    for other in [cube.clone(), turned_inside_out(cube.clone())] {
        is_the_cube(&mended(&joined(&[cube.clone(), other]), 12, 0));
    }
    // Two that touch along an edge.
    let beside = joined(&[cube.clone(), cube_at(DVec3::new(9.0, -1.0, 2.0), 1.0)]);
    assert_eq!(mended(&beside, 0, 0), beside);
}

#[test]
fn hollows_face_inwards_and_islands_outwards() {
    let (outer, inner) = (cube_at(DVec3::ZERO, 3.0), cube_at(DVec3::splat(0.2), 1.0));
    let core = cube_at(DVec3::splat(0.2), 0.5);
    let apart = cube_at(DVec3::X * 9.0, 1.0);
    let hollow = joined(&[outer.clone(), turned_inside_out(inner.clone())]);
    assert_eq!(mended(&hollow, 0, 0), hollow);
    assert!((volume(&mended(&joined(&[outer.clone(), inner.clone()]), 0, 12)) - 48.0 * 26.0).abs() < 1e-9);
    let all = joined(&[core, turned_inside_out(outer), inner, turned_inside_out(apart)]);
    let volume = volume(&mended(&all, 0, 36));
    assert!((volume - 48.0 * (27.0 - 1.0 + 0.125 + 1.0)).abs() < 1e-9, "{volume}");
}

#[test]
fn many_hollows_stay_hollows() {
    let bubbles = (0..300).map(|i| turned_inside_out(cube_at(DVec3::new(f64::from(i) - 150.0, 0.0, 0.0), 0.1)));
    let all = joined(
        &std::iter::once(cube_at(DVec3::ZERO, 200.0))
            .chain(bubbles)
            .collect::<Vec<_>>(),
    );
    assert_eq!(mended(&all, 0, 0), all);
    assert_eq!(
        mended(&turned_inside_out(all.clone()), 0, 12 * 301).triangles,
        all.triangles
    );
}

#[test]
fn what_is_open_is_told_of() {
    let mut hole = RawMesh::cube();
    hole.triangles.truncate(10);
    let opening = hole.solid().unwrap_err();
    assert_eq!((opening.edges, opening.why), (4, "belongs to one triangle only"));
    assert!(
        opening
            .to_string()
            .ends_with("belongs to one triangle only, and 3 more"),
        "{opening}"
    );
    assert_eq!(RawMesh::rectangle().solid().unwrap_err().edges, 4);
    // A sheet with a face per side encloses nothing.
    let sheet = joined(&[RawMesh::rectangle(), turned_inside_out(RawMesh::rectangle())]);
    assert_eq!(sheet.solid().unwrap_err().edges, 4);
    assert!(RawMesh::default().solid().is_ok());
    let mut nothing = RawMesh::cube();
    nothing.positions.iter_mut().for_each(|p| *p = DVec3::splat(f64::NAN));
    let _ = nothing.solid();
}

/// A ball of rings and segments, with bumps.
fn ball(rings: u32, segments: u32, radius: f64, center: DVec3) -> RawMesh {
    let point = |ring: u32, segment: u32| {
        let (theta, phi) = (
            std::f64::consts::PI * f64::from(ring) / f64::from(rings),
            std::f64::consts::TAU * f64::from(segment) / f64::from(segments),
        );
        let bump = 1.0 + 0.01 * libm::sin(9.0 * theta) * libm::sin(9.0 * phi);
        let (sin, cos) = libm::sincos(theta);
        center + radius * bump * DVec3::new(sin * libm::cos(phi), sin * libm::sin(phi), cos)
    };
    let mut mesh = RawMesh::default();
    mesh.positions
        .extend([center + DVec3::Z * radius, center - DVec3::Z * radius]);
    let at = |ring: u32, segment: u32| match ring {
        0 => 0,
        _ if ring == rings => 1,
        _ => 2 + (ring - 1) * segments + segment % segments,
    };
    for ring in 0..rings {
        for segment in 0..segments {
            if ring > 0 {
                mesh.positions.push(point(ring, segment));
            }
            let [a, b] = [at(ring, segment), at(ring, segment + 1)];
            let [c, d] = [at(ring + 1, segment), at(ring + 1, segment + 1)];
            let triangles = [[a, c, b], [b, c, d]];
            let has_corners = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
            mesh.triangles.extend(triangles.into_iter().filter(has_corners));
        }
    }
    mesh
}

/// A cube whose top is divided into that many squares a side, under a map in its plane; its neighbours are not divided.
fn cube_with_cut_top(squares: u32, map: DAffine3) -> RawMesh {
    let mut mesh = cube_at(DVec3::ZERO, 1.0);
    mesh.triangles
        .retain(|t| t.iter().any(|v| mesh.positions[*v as usize].z < 0.5));
    let first = mesh.positions.len() as u32;
    for y in 0..=squares {
        for x in 0..=squares {
            let at = |i: u32| 2.0 * f64::from(i) / f64::from(squares) - 1.0;
            mesh.positions.push(DVec3::new(at(x), at(y), 1.0));
            mesh.uvs.push(DVec2::new(at(x), at(y)));
        }
    }
    for y in 0..squares {
        for x in 0..squares {
            let a = first + y * (squares + 1) + x;
            let [b, c, d] = [a + 1, a + squares + 1, a + squares + 2];
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    mesh.positions.iter_mut().for_each(|p| *p = map.transform_point3(*p));
    mesh
}

#[test]
fn an_edge_beside_shorter_ones_is_cut() {
    let tilted = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.3, 0.7, 1.1),
        DQuat::from_euler(EulerRot::XYZ, 0.4, 0.9, -0.3),
        DVec3::new(5.0, -3.0, 11.0),
    );
    for (map, scale) in [(DAffine3::IDENTITY, 1.0), (tilted, 0.3 * 0.7 * 1.1)] {
        for squares in [2, 3, 7] {
            let mut mesh = cube_with_cut_top(squares, map);
            if scale != 1.0 {
                // Rounded as in single-precision files.
                mesh.positions.iter_mut().for_each(|p| *p = p.as_vec3().as_dvec3());
            }
            let solid = mesh.solid().unwrap();
            assert_eq!((solid.doubled, solid.turned, solid.cut), (0, 0, 4), "{squares} squares");
            let mended = solid.mended.unwrap();
            assert_eq!(
                mended.triangles.len(),
                mesh.triangles.len() + 4 * (squares as usize - 1)
            );
            assert_eq!(mended.uvs.len(), mended.positions.len());
            assert!((volume(&mended) - 48.0 * scale).abs() < 1e-5, "{}", volume(&mended));
            assert!(mended.to_mesh(&DAffine3::IDENTITY, false, &[]).is_closed());
            // Reversed and duplicate faces are mended as well.
            let mut worse = mesh.clone();
            worse.triangles[0].swap(0, 1);
            worse.triangles.push(worse.triangles[3]);
            let solid = worse.solid().unwrap();
            assert_eq!((solid.doubled, solid.cut), (1, 4));
            assert!((volume(&solid.mended.unwrap()) - 48.0 * scale).abs() < 1e-5);
        }
    }
}

#[test]
fn sides_that_are_cut_in_different_places_fit() {
    // A prism of two squares whose mantle has edges that end elsewhere.
    let mut mesh = RawMesh::default();
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let point = |i: usize, share: f64, z: f64| {
        let (from, to) = (corners[i % 4], corners[(i + 1) % 4]);
        let mix = |a: f64, b: f64| a + (b - a) * share;
        DVec3::new(mix(from.0, to.0), mix(from.1, to.1), z)
    };
    let mut add = |triangle: [DVec3; 3]| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(triangle);
        mesh.triangles.push([first, first + 1, first + 2]);
    };
    let middle = |z: f64| DVec3::new(0.5, 0.5, z);
    for i in 0..4 {
        add([middle(0.0), point(i, 1.0, 0.0), point(i, 0.0, 0.0)]);
        for half in [0.0, 0.5] {
            add([middle(1.0), point(i, half, 1.0), point(i, half + 0.5, 1.0)]);
        }
        for third in 0..3 {
            let [from, to] = [third, third + 1].map(|n| f64::from(n) / 3.0);
            let [a, b, c, d] = [
                point(i, from, 0.0),
                point(i, to, 0.0),
                point(i, to, 1.0),
                point(i, from, 1.0),
            ];
            add([a, b, c]);
            add([a, c, d]);
        }
    }
    let solid = mesh.solid().unwrap();
    // Below, one edge per side; above, both halves and the middle third.
    assert_eq!(solid.cut, 4 + 8 + 4);
    assert!((volume(&solid.mended.unwrap()) - 6.0).abs() < 1e-9);
    // Without one triangle it has a hole, described by the edges of the original mesh.
    mesh.triangles.pop();
    assert_eq!(mesh.solid().unwrap_err(), mesh.solid_of(false).unwrap_err());
}

#[test]
fn names_of_materials_stay_with_their_triangles() {
    let mut mesh = cube_with_cut_top(2, DAffine3::IDENTITY);
    let of = |mesh: &RawMesh, number: usize| {
        let named = mesh.materials.iter().rev().find(|(first, _)| *first <= number);
        named.map(|(_, name)| name.clone())
    };
    mesh.materials = (0..mesh.triangles.len())
        .map(|i| (i, format!("{}", mesh.triangles[i][2])))
        .collect();
    mesh.triangles.insert(5, mesh.triangles[4]);
    for (first, _) in &mut mesh.materials[5..] {
        *first += 1;
    }
    let mended = mesh.solid().unwrap().mended.unwrap();
    let plane = |mesh: &RawMesh, number: usize| {
        let [a, b, c] = mesh.triangles[number].map(|v| mesh.positions[v as usize]);
        let n = (b - a).cross(c - a).normalize();
        (n, n.dot(a))
    };
    for number in 0..mended.triangles.len() {
        let name = of(&mended, number);
        let was = (0..mesh.triangles.len()).find(|i| of(&mesh, *i) == name).unwrap();
        let ((n, d), (m, e)) = (plane(&mended, number), plane(&mesh, was));
        assert!((n - m).length() < 1e-9 && (d - e).abs() < 1e-9, "triangle {number}");
    }
}

/// Crossing parts are reported; touching and nested ones are not.
#[test]
fn parts_that_cross_are_found() {
    let crossing = |meshes: &[RawMesh]| joined(meshes).solid().unwrap().crossing;
    let unit = cube_at(DVec3::ZERO, 1.0);
    let is_near = |found: Option<DVec3>, low: DVec3, high: DVec3| {
        found.is_some_and(|p| p.cmpge(low - 1e-3).all() && p.cmple(high + 1e-3).all())
    };
    // Their diagonals meet the edges; one is inside out, and one lies apart.
    for other in [cube_at(DVec3::ONE, 1.0), turned_inside_out(cube_at(DVec3::ONE, 1.0))] {
        let found = crossing(&[unit.clone(), other, cube_at(DVec3::X * 9.0, 1.0)]);
        assert!(is_near(found, DVec3::ZERO, DVec3::ONE), "{found:?}");
    }
    // No corner of either is inside the other.
    let cross = |axis: DVec3| {
        let mut beam = unit.clone();
        beam.positions
            .iter_mut()
            .for_each(|p| *p *= DVec3::splat(0.5) + 4.0 * axis);
        beam
    };
    assert!(crossing(&[cross(DVec3::X), cross(DVec3::Y)]).is_some());
    // Juice that reaches into the surrounding glass.
    let cup = |radius: f64| {
        let mut cup = ball(24, 24, 1.0, DVec3::ZERO);
        cup.positions.iter_mut().for_each(|p| *p *= radius);
        cup
    };
    let [glass, hollow] = [cup(1.0), turned_inside_out(cup(0.9))];
    let juice = |radius: f64| {
        let mut juice = cup(radius);
        juice.positions.iter_mut().for_each(|p| p.z = p.z.min(0.1));
        juice
    };
    assert_eq!(crossing(&[glass.clone(), hollow.clone(), juice(0.88)]), None);
    assert!(crossing(&[glass.clone(), hollow.clone(), juice(0.91)]).is_some());
    let big = [
        ball(80, 80, 1.0, DVec3::ZERO),
        ball(80, 80, 1.0, DVec3::new(0.1, 0.0, 0.0)),
    ];
    assert!(crossing(&big).is_some());
    assert_eq!(
        crossing(&[big[0].clone(), turned_inside_out(ball(80, 80, 0.97, DVec3::ZERO))]),
        None
    );
    // Next to each other, and on top of each other.
    let touching = [
        DVec3::new(2.0, 2.0, 0.0),
        DVec3::new(2.0, 2.0, 2.0),
        DVec3::new(2.0, 0.5, 0.3),
        DVec3::new(0.0, 0.0, 2.0),
        DVec3::new(0.7, 0.7, 2.0),
    ];
    for place in touching {
        let both = joined(&[unit.clone(), cube_at(place, 1.0)]);
        assert_eq!(both.solid().unwrap().crossing, None, "at {place}");
        assert_eq!(mended(&both, 0, 0), both, "at {place}");
    }
    let mut on_top = cross(DVec3::Y);
    on_top.positions.iter_mut().for_each(|p| p.z += 1.0);
    assert_eq!(crossing(&[cross(DVec3::X), on_top.clone()]), None);
    on_top.positions.iter_mut().for_each(|p| p.z -= 0.01);
    assert!(crossing(&[cross(DVec3::X), on_top]).is_some());
    // A hollow that reaches out of its part.
    assert!(crossing(&[unit.clone(), turned_inside_out(cube_at(DVec3::Z * 0.9, 0.5))]).is_some());
    assert_eq!(
        crossing(&[unit.clone(), turned_inside_out(cube_at(DVec3::Z * 0.5, 0.5))]),
        None
    );
}
