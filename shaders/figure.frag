#version 300 es
// The person's figure: where the shown frame itself saw this place, squarely and
// near enough, its own colours; elsewhere those gathered over the take; and
// smoothly from the one to the other.
precision highp float;

centroid in vec4 now_point;
centroid in vec4 now_facing;
centroid in vec4 borrowed;

uniform vec4 color_lens[3];           // of the shown frame's colours, as view_lens
uniform vec4 depth_lens[3];           // of its depth
uniform vec4 depth_from_color[3];     // rows, metres
uniform vec4 kind;                    // x: 1 to write where colours are from instead of them; y: the shown frame's
                                      // time, seconds of the take; z: 1 if it has colours and depth
uniform highp sampler2D now_picture;
uniform highp sampler2D now_depth;    // millimetres (high, low byte); blue: 0 at the person's edge and elsewhere, 1 well within

out vec4 color; // premultiplied

vec2 placed(vec3 p, vec4 lens[3])
{
    vec4 k = lens[1];
    vec2 q = p.xy / p.z;
    float r2 = min(dot(q, q), lens[2].y);
    float radial = 1.0 + r2 * (k.x + r2 * (k.y + r2 * lens[2].x));
    vec2 bent = q * radial + vec2(2.0 * k.z * q.x * q.y + k.w * (r2 + 2.0 * q.x * q.x),
                                  k.z * (r2 + 2.0 * q.y * q.y) + 2.0 * k.w * q.x * q.y);
    return lens[0].xy * bent + lens[0].zw;
}

// How much the shown frame's own colours are to be believed here.
float seen_now()
{
    vec3 p = now_point.xyz;
    vec4 h = vec4(p, 1.0);
    vec3 d = vec3(dot(depth_from_color[0], h), dot(depth_from_color[1], h), dot(depth_from_color[2], h));
    if (kind.z < 0.5 || p.z < 0.05 || d.z < 0.05)
        return 0.0;
    vec2 size = depth_lens[2].zw;
    ivec2 at = ivec2(floor(placed(d, depth_lens) + 0.5));
    if (at.x < 0 || at.y < 0 || at.x >= int(size.x) || at.y >= int(size.y))
        return 0.0;
    vec4 there = texelFetch(now_depth, at, 0);
    float off = abs((there.r * 256.0 + there.g) * 0.255 - d.z);
    float squarely = smoothstep(0.15, 0.45, -dot(normalize(now_facing.xyz), normalize(p)));
    return squarely * there.b * (1.0 - smoothstep(0.05, 0.09, off));
}

void main()
{
    if (borrowed.w > 0.5)
        discard;
    float now = seen_now();
    if (kind.x > 0.5) {
        float age = min(floor(abs(now_point.w - kind.y) * 100.0 + 0.5), 65535.0);
        float what = now > 0.5 ? 85.0 : now_facing.w > 0.5 ? 255.0 : 170.0;
        vec2 bytes = now > 0.5 ? vec2(0.0) : vec2(floor(age / 256.0), mod(age, 256.0));
        color = vec4(what / 255.0, bytes / 255.0, 1.0);
        return;
    }
    vec3 rgb = sqrt(clamp(borrowed.rgb, 0.0, 1.0));
    if (now > 0.0)
        rgb = mix(rgb, texture(now_picture, (placed(now_point.xyz, color_lens) + 0.5) / color_lens[2].zw).rgb, now);
    color = vec4(rgb, 1.0);
}
