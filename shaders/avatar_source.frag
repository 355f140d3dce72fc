#version 300 es
// Fragment of the avatar that encodes where its colour comes from, as renderer_read_source documents.
precision highp float;

in vec4 uv;
in vec4 frame_sample;

uniform vec4 frame_params;          // x: the shown frame's time, seconds of the take
uniform highp sampler2D atlas_when; // time seen, hundredths of a second, bytes in a, r, g; blue: 1 if never seen

out vec4 color;

#include "depth_agreement.glsl"

void main()
{
    float own = depth_agreement(frame_sample);
    vec4 when = texture(atlas_when, uv.xy);
    vec3 bytes_seen = floor(when.arg * 255.0 + 0.5);
    float seen_time = dot(bytes_seen, vec3(65536.0, 256.0, 1.0));
    float age = min(abs(seen_time - floor(frame_params.x * 100.0 + 0.5)), 65535.0);
    float source = own > 0.5 ? 85.0 : when.b > 0.5 ? 255.0 : 170.0;
    vec2 bytes = own > 0.5 ? vec2(0.0) : vec2(floor(age / 256.0), mod(age, 256.0));
    color = vec4(source / 255.0, bytes / 255.0, 1.0);
}
