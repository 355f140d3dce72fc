#version 300 es
// Vertex of the occluder mesh or of the floor patch that takes the shadow: from the world to the viewer's image, lens
// distortion included.
precision highp float;

layout(location = 0) in vec4 point; // w: 0 occluder mesh, metres; 1 floor patch, -1 to 1

uniform vec4 viewer_from_room[3];  // rows of the map from the world into the viewer camera's axes, metres
uniform vec4 viewer_from_floor[3]; // the same from the floor patch's axes
uniform vec4 world_from_floor[3];  // from the floor patch's axes into the world
uniform vec4 view_lens[3];         // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range;           // nearest and farthest z drawn, depth bias of the room and of the floor, metres

out vec4 world; // of the floor; w as point's

#include "lens.glsl"

void main()
{
    vec4 h = vec4(point.xyz, 1.0);
    vec3 of_room = vec3(dot(viewer_from_room[0], h), dot(viewer_from_room[1], h), dot(viewer_from_room[2], h));
    vec3 of_floor = vec3(dot(viewer_from_floor[0], h), dot(viewer_from_floor[1], h), dot(viewer_from_floor[2], h));
    vec3 p = point.w > 0.5 ? of_floor : of_room;
    world = vec4(dot(world_from_floor[0], h), dot(world_from_floor[1], h), dot(world_from_floor[2], h), point.w);
    vec2 d = distort_vertex(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    vec2 px = view_lens[0].xy * d + (view_lens[0].zw + 0.5) * p.z;
    // Projected from p, with the depth of z (bias).
    float n = view_range.x, f = view_range.y, z = p.z + (point.w > 0.5 ? view_range.w : view_range.z);
    gl_Position = vec4((2.0 * px / view_lens[2].zw - p.z) * (z / p.z), ((f + n) * z - 2.0 * f * n) / (f - n), z);
    if (p.z < n)
        gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, -1.0, p.z); // nearer than the near plane: clipped
}
