// Places the tube that the ropes of a crowd share along the particles of one of them.
//
// `position` of a vertex is (the number of an entry and the part of the way to the next one, once around, from -1 to 1
// over the rounded ends); the tag of the mesh is the first entry of its rope. tubes.rs has the same in its test.

#import bevy_pbr::{mesh_functions, view_transformations::position_world_to_clip}
#ifdef PREPASS_PIPELINE
#import bevy_pbr::prepass_io::{Vertex, VertexOutput}
#else
#import bevy_pbr::forward_io::{Vertex, VertexOutput}
#endif

struct Entry {
    // xyz: where the particle is in the world; w: the cross-sections a link.
    place: vec4<f32>,
    // xyz: the normal of its frame; w: the radius of the tube.
    normal: vec4<f32>,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<storage, read> entries: array<Entry>;

const PI: f32 = 3.14159265358979;

fn normalize_or(vector: vec3<f32>, fallback: vec3<f32>) -> vec3<f32> {
    let square = dot(vector, vector);
    if square > 1e-24 {
        return vector * inverseSqrt(square);
    }
    return fallback;
}

// A Catmull–Rom spline through the particles.
fn centre_at(first: u32, along: f32) -> vec3<f32> {
    let entry = first + u32(floor(along));
    let t = fract(along);
    let before = entries[entry - 1u].place.xyz;
    let here = entries[entry].place.xyz;
    let there = entries[entry + 1u].place.xyz;
    let after = entries[min(entry + 2u, arrayLength(&entries) - 1u)].place.xyz;
    let outer = -0.5 * t * (1.0 - t);
    let inner = 1.0 - t;
    let bent = 0.5 * t * inner * (1.0 - 2.0 * t);
    return here * (inner + bent) + there * (t - bent)
        + (before - here) * (outer * inner) + (after - there) * (outer * t);
}

// Half-way between the directions to the cross-sections before and after.
fn axis_at(first: u32, along: f32, rings: f32) -> vec3<f32> {
    let here = centre_at(first, along);
    let before = here - centre_at(first, along - 1.0 / rings);
    let after = centre_at(first, along + 1.0 / rings) - here;
    let none = vec3(0.0);
    return normalize_or(normalize_or(before, none) + normalize_or(after, none), vec3(0.0, -1.0, 0.0));
}

fn any_orthonormal(axis: vec3<f32>) -> vec3<f32> {
    let side = select(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), abs(axis.x) > 0.5);
    return normalize(cross(axis, side));
}

fn orthonormal(normal: vec3<f32>, axis: vec3<f32>) -> vec3<f32> {
    return normalize_or(normal - axis * dot(axis, normal), any_orthonormal(axis));
}

// By double reflection: see tube.rs.
fn transport(normal: vec3<f32>, before: vec3<f32>, here: vec3<f32>, way: vec3<f32>) -> vec3<f32> {
    var turned = normal;
    var axis = before;
    let square = dot(way, way);
    if square > 0.0 {
        turned -= way * (2.0 * dot(way, turned) / square);
        axis -= way * (2.0 * dot(way, axis) / square);
    }
    let change = here - axis;
    let change_square = dot(change, change);
    if change_square > 1e-12 {
        turned -= change * (2.0 * dot(change, turned) / change_square);
    }
    return orthonormal(turned, here);
}

@vertex
fn vertex(vertex: Vertex) -> VertexOutput {
    var out: VertexOutput;
    let first = mesh_functions::get_tag(vertex.instance_index);
    let along = vertex.position.x;
    let start = floor(along);
    let known = entries[first + u32(start)];
    let rings = known.place.w;
    let centre = centre_at(first, along);
    let axis = axis_at(first, along, rings);
    var normal: vec3<f32>;
    if along == start {
        normal = orthonormal(known.normal.xyz, axis);
    } else {
        let before = axis_at(first, start, rings);
        normal = transport(orthonormal(known.normal.xyz, before), before, axis, centre - known.place.xyz);
    }
    let binormal = cross(axis, normal);
    let angle = 2.0 * PI * fract(vertex.position.y);
    let cap = 0.5 * PI * vertex.position.z;
    let outward = (normal * cos(angle) + binormal * sin(angle)) * cos(cap) + axis * sin(cap);

    out.world_position = vec4(centre + outward * known.normal.w, 1.0);
    out.position = position_world_to_clip(out.world_position.xyz);
#ifdef VERTEX_UVS_A
    out.uv = vertex.uv;
#endif

#ifdef PREPASS_PIPELINE
#ifdef UNCLIPPED_DEPTH_ORTHO_EMULATION
    out.unclipped_depth = out.position.z;
    out.position.z = min(out.position.z, 1.0);
#endif
#ifdef NORMAL_PREPASS_OR_DEFERRED_PREPASS
#ifdef VERTEX_NORMALS
    out.world_normal = outward;
#endif
#ifdef VERTEX_TANGENTS
    out.world_tangent = vec4(binormal * cos(angle) - normal * sin(angle), -1.0);
#endif
#endif
#ifdef MOTION_VECTOR_PREPASS
    out.previous_world_position = out.world_position;
#endif
#else
#ifdef VERTEX_NORMALS
    out.world_normal = outward;
#endif
#ifdef VERTEX_TANGENTS
    out.world_tangent = vec4(binormal * cos(angle) - normal * sin(angle), -1.0);
#endif
#endif

#ifdef VERTEX_OUTPUT_INSTANCE_INDEX
    out.instance_index = vertex.instance_index;
#endif
#ifdef VISIBILITY_RANGE_DITHER
    out.visibility_range_dither = mesh_functions::get_visibility_range_dither_level(
        vertex.instance_index, mesh_functions::get_world_from_local(vertex.instance_index)[3]);
#endif
    return out;
}
