#version 300 es
// The colour of a body part's point is what the chosen frame shows there.
precision highp float;

in vec3 source_point;

uniform vec4 source_lens[3]; // as view_lens
uniform vec4 source_window;  // the texture's place in that frame: left, top, width, height, pixels
uniform vec4 code;           // w: 1 to write xyz instead of colours
uniform highp sampler2D source_image;

out vec4 color; // premultiplied

vec2 distorted(vec3 p, vec4 k, float k3, float largest)
{
    vec2 q = p.xy / p.z;
    float r2 = min(dot(q, q), largest);
    float radial = 1.0 + r2 * (k.x + r2 * (k.y + r2 * k3));
    return q * radial + vec2(2.0 * k.z * q.x * q.y + k.w * (r2 + 2.0 * q.x * q.x),
                             k.z * (r2 + 2.0 * q.y * q.y) + 2.0 * k.w * q.x * q.y);
}

void main()
{
    if (source_point.z < 1e-3)
        discard; // never before that camera
    vec2 px = source_lens[0].xy * distorted(source_point, source_lens[1], source_lens[2].x, source_lens[2].y) +
              source_lens[0].zw;
    vec4 seen = texture(source_image, (px - source_window.xy + 0.5) / source_window.zw);
    color = vec4(code.w > 0.5 ? code.xyz : seen.rgb, 1.0);
}
