//! Makes meshes of what bodies are shaped like.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use dcd::rapier3d::parry::shape::{Shape, TypedShape};

/// Returns the meshes of a shape, each with its place on it.
pub fn meshes(shape: &dyn Shape) -> Vec<(Mesh, Transform)> {
    let middle = |mesh: Mesh| vec![(mesh, Transform::default())];
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => middle(Sphere::new(ball.radius).into()),
        TypedShape::Cuboid(cuboid) => {
            middle(Cuboid { half_size: Vec3::from_array(cuboid.half_extents.to_array()) }.into())
        }
        TypedShape::Cylinder(cylinder) => {
            middle(Cylinder::new(cylinder.radius, 2.0 * cylinder.half_height).into())
        }
        TypedShape::Cone(cone) => middle(Cone::new(cone.radius, 2.0 * cone.half_height).into()),
        TypedShape::Capsule(capsule) => {
            let [a, b] = [capsule.segment.a, capsule.segment.b].map(|end| Vec3::from_array(end.to_array()));
            let along = (b - a).try_normalize().unwrap_or(Vec3::Y);
            let place = Transform::from_translation(0.5 * (a + b))
                .with_rotation(Quat::from_rotation_arc(Vec3::Y, along));
            vec![(Capsule3d::new(capsule.radius, a.distance(b)).into(), place)]
        }
        TypedShape::HalfSpace(space) => {
            let normal = Dir3::new(Vec3::from_array(space.normal.to_array())).unwrap_or(Dir3::Y);
            middle(Plane3d { normal, half_size: Vec2::splat(1000.0) }.into())
        }
        TypedShape::Compound(compound) => {
            let parts = compound.shapes().iter().flat_map(|(pose, part)| {
                let place = Transform::from_translation(Vec3::from_array(pose.translation.to_array()))
                    .with_rotation(Quat::from_array(pose.rotation.to_array()));
                meshes(&**part).into_iter().map(move |(mesh, at)| (mesh, place * at))
            });
            parts.collect()
        }
        TypedShape::ConvexPolyhedron(hull) => middle(triangles(hull.to_trimesh())),
        TypedShape::TriMesh(mesh) => middle(triangles((mesh.vertices().to_vec(), mesh.indices().to_vec()))),
        TypedShape::HeightField(field) => middle(triangles(field.to_trimesh())),
        TypedShape::Voxels(voxels) => middle(triangles(voxels.to_trimesh())),
        // What is rounded is drawn without the border that rounds it.
        TypedShape::RoundCuboid(round) => meshes(&round.inner_shape),
        TypedShape::RoundCylinder(round) => meshes(&round.inner_shape),
        TypedShape::RoundCone(round) => meshes(&round.inner_shape),
        TypedShape::RoundConvexPolyhedron(round) => meshes(&round.inner_shape),
        _ => Vec::new(),
    }
}

/// Flat shaded: each triangle has corners of its own.
fn triangles((corners, triangles): (Vec<dcd::prelude::Vector>, Vec<[u32; 3]>)) -> Mesh {
    let corners: Vec<[f32; 3]> = corners.iter().map(|corner| corner.to_array()).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners)
        .with_inserted_indices(Indices::U32(triangles.into_flattened()))
        .with_duplicated_vertices()
        .with_computed_flat_normals()
}
