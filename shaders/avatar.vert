#version 300 es
// Vertex of the avatar: from the viewer camera's axes to its image, lens distortion included. What does not depend on
// the viewer is computed once per frame (frame_layer.h).
precision highp float;

// Viewer camera's axes, metres; w: opacity, 0 at the ribbon's outer rim, else 1.
layout(location = 0) in vec4 point;
// xy: in the atlas; zw: in the frame's colour image; 0 to 1.
layout(location = 1) in vec4 vertex_uv;
// xy: in the frame's depth image, 0 to 1; z: expected depth, metres; w: visibility.
layout(location = 2) in vec4 vertex_sample;
// xyz: normal, axes of the frame's colour camera; w: sqrt(irradiance).
layout(location = 3) in vec4 normal_and_light;

uniform vec4 viewer_from_frame[3]; // rows of the rotation from those axes into the viewer camera's
uniform vec4 view_lens[3];         // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range;           // nearest and farthest z drawn, metres
uniform vec4 frame_params;         // x: shown frame's time, seconds of the take; y: half the ribbon's width, pixels

out vec4 uv;           // as vertex_uv
out vec4 frame_sample; // as vertex_sample
out vec2 lighting;     // sqrt(irradiance), opacity

#include "lens.glsl"

void main()
{
    uv = vertex_uv;
    frame_sample = vertex_sample;
    lighting = vec2(normal_and_light.w, point.w);

    vec3 p = point.xyz;
    vec2 b = distort_vertex(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    // Pixels, times z; half a pixel because (0, 0) is the first pixel's centre.
    vec2 px = view_lens[0].xy * b + (view_lens[0].zw + 0.5) * p.z;
    // At the silhouette, vertices move inwards by half the ribbon's width and their doubles outwards; vertices that
    // face the viewer do not move.
    vec3 normal = normal_and_light.xyz;
    vec3 outwards = vec3(dot(viewer_from_frame[0].xyz, normal), dot(viewer_from_frame[1].xyz, normal),
                         dot(viewer_from_frame[2].xyz, normal));
    vec2 aside = outwards.xy - p.xy * (outwards.z / p.z);
    float sine = max(length(aside), 1e-3);
    px += (1.0 - 2.0 * point.w) * frame_params.y * p.z * smoothstep(0.8, 0.95, sine) / sine * aside;
    float n = view_range.x, far = view_range.y;
    gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, ((far + n) * p.z - 2.0 * far * n) / (far - n), p.z);
}
