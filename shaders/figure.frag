#version 300 es
// The person at full detail. What the shown frame saw takes its colours from that
// very frame; the rest of each part's model from the frame chosen for it. The
// shown frame's depth also says where nobody is: the model ends there.
precision highp float;

centroid in vec3 source_point;
centroid in vec3 now_point;

uniform vec4 source_lens[3]; // as view_lens
uniform vec4 source_window;  // the texture's place in that frame: left, top, width, height, pixels
uniform vec4 now_lens[3];    // SURFACE: the colour camera's; else the depth camera's
uniform vec4 kind;           // x: one of the below; y: 1 to write codes instead of colours; z: 1 if there is a
                             // borrowed texture; w: metres it stands back behind what else is there
uniform vec4 code;           // xy: age of the borrowed frame, hundredths of a second, high and low byte / 255
uniform highp sampler2D source_picture;
uniform highp sampler2D now_picture; // the shown frame's colours
uniform highp sampler2D now_depth;   // its depth: millimetres (high, low byte); blue: 1 surface, 0.5 the person's rim and gaps

out vec4 color; // premultiplied

const float WHOLE = 0.0, CARVED = 1.0, SURFACE = 2.0; // a model; a model less what was seen; what was seen

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

// Is the model here where the shown frame looked through, or what it saw itself?
bool refuted(vec3 p)
{
    if (p.z < 1e-3)
        return false;
    vec2 size = now_lens[2].zw;
    ivec2 at = ivec2(floor(placed(p, now_lens) + 0.5));
    if (at.x < 0 || at.y < 0 || at.x >= int(size.x) || at.y >= int(size.y))
        return false;
    vec4 seen = texelFetch(now_depth, at, 0);
    float depth = (seen.r * 256.0 + seen.g) * 0.255;
    float slack = 0.02 + 0.002 * depth * depth; // the reading's own error grows so
    if (seen.b > 0.75)
        return p.z < depth; // just behind it goes on, so that no gap opens at the surface's edge
    if (seen.b > 0.25)
        return false;
    if (depth > 0.0)
        return p.z < depth - slack - 0.03; // feet stand close before the floor
    return true;
}

void main()
{
    bool surface = kind.x == SURFACE;
    if (kind.x == CARVED && refuted(now_point))
        discard;
    bool front = !gl_FrontFacing; // rows run downwards in our pictures, which turns triangles over
    bool now = surface && (front || kind.z < 0.5);
    vec3 rgb;
    if (now) {
        rgb = texture(now_picture, (placed(now_point, now_lens) + 0.5) / now_lens[2].zw).rgb;
    } else {
        if (source_point.z < 1e-3)
            discard; // never before that camera
        rgb = texture(source_picture, (placed(source_point, source_lens) - source_window.xy + 0.5) / source_window.zw).rgb;
    }
    if (kind.y > 0.5) {
        bool filled = surface && !front;
        rgb = vec3(filled ? 1.0 : now ? 85.0 / 255.0 : 170.0 / 255.0, now ? vec2(0.0) : code.xy);
    }
    color = vec4(rgb, 1.0);
}
