#version 300 es
// Vertex of a body cylinder: from the part's axes to the viewer's image, lens distortion included.
precision highp float;

layout(location = 0) in vec3 local; // x, y across the bone, in radii; z along it, in bone lengths

uniform vec4 viewer_from_part[3]; // rows of the affine map into the viewer camera's axes, metres
uniform vec4 source_from_part[3]; // the same into the source camera's axes
uniform vec4 view_lens[3];        // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range;          // nearest and farthest z drawn, metres

out vec3 source_point; // source colour camera's axes, metres

#include "lens.glsl"

void main()
{
    vec4 h = vec4(local, 1.0);
    vec3 p = vec3(dot(viewer_from_part[0], h), dot(viewer_from_part[1], h), dot(viewer_from_part[2], h));
    source_point = vec3(dot(source_from_part[0], h), dot(source_from_part[1], h), dot(source_from_part[2], h));

    vec2 d = distort_vertex(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    // Pixels, times z; half a pixel because (0, 0) is the first pixel's centre.
    vec2 px = view_lens[0].xy * d + (view_lens[0].zw + 0.5) * p.z;
    float n = view_range.x, f = view_range.y;
    gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, ((f + n) * p.z - 2.0 * f * n) / (f - n), p.z);
}
