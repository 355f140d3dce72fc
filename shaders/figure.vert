#version 300 es
// One body part, or what the shown frame saw of it: from its own axes to the
// tablet's picture, lens and all.
precision highp float;

layout(location = 0) in vec3 local; // a part: transverse in radii (x, y), along the bone in its lengths (z); a seen surface: metres

uniform vec4 viewer_from_part[3]; // rows of the affine map into the tablet camera's axes, metres
uniform vec4 source_from_part[3]; // the same into the axes of the camera that took the texture
uniform vec4 now_from_part[3];    // the same into the axes of now_lens's camera at the shown frame
uniform vec4 view_lens[3];        // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 kind;                // w: metres it stands back behind what else is there
uniform vec4 view_range;          // nearest and farthest z that are drawn, metres

// (At a triangle's edge never beyond it: what lies there is somebody else's.)
centroid out vec3 source_point; // colour camera's axes of the texture's frame, metres
centroid out vec3 now_point;    // now_lens's camera of the shown frame, metres

// Where (x, y) / z falls, times z: Brown-Conrady. Beyond the picture's corners
// the polynomial may fold back, so the factor is held there; in front of and
// behind the lens's plane the map then stays linear and clipping stays right.
vec2 distorted(vec3 p, vec4 k, float k3, float largest)
{
    vec2 q = p.xy / max(p.z, 1e-4);
    float r2 = dot(q, q);
    if (p.z < 1e-4 || r2 > largest) {
        r2 = largest;
        return p.xy * (1.0 + r2 * (k.x + r2 * (k.y + r2 * k3)));
    }
    float radial = 1.0 + r2 * (k.x + r2 * (k.y + r2 * k3));
    vec2 tangential = vec2(2.0 * k.z * q.x * q.y + k.w * (r2 + 2.0 * q.x * q.x),
                           k.z * (r2 + 2.0 * q.y * q.y) + 2.0 * k.w * q.x * q.y);
    return (q * radial + tangential) * p.z;
}

void main()
{
    vec4 h = vec4(local, 1.0);
    vec3 p = vec3(dot(viewer_from_part[0], h), dot(viewer_from_part[1], h), dot(viewer_from_part[2], h));
    source_point = vec3(dot(source_from_part[0], h), dot(source_from_part[1], h), dot(source_from_part[2], h));
    now_point = vec3(dot(now_from_part[0], h), dot(now_from_part[1], h), dot(now_from_part[2], h));

    vec2 d = distorted(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    // Pixels, times z; half a pixel because (0, 0) is the first pixel's centre.
    vec2 px = view_lens[0].xy * d + (view_lens[0].zw + 0.5) * p.z;
    float n = view_range.x, f = view_range.y;
    float back = p.z + kind.w;
    float depth = ((f + n) * back - 2.0 * f * n) / ((f - n) * back);
    gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, p.z < n ? ((f + n) * p.z - 2.0 * f * n) / (f - n) : depth * p.z, p.z);
}
