#include "formats/bvh_printer.h"

#include "base/portable_math.h"

static const double CM = 100;
static const double DEG = 57.29577951308232;

static void print_offset(int indent, struct vec3 metres, FILE *out)
{
    fprintf(out, "%*sOFFSET %.5f %.5f %.5f\n", indent, "", CM * metres.x, CM * metres.y, CM * metres.z);
}

static bool has_positions(const struct bvh_bone *bone) { return bone->parent == BVH_ROOT || bone->has_positions; }

static int depth_of(const struct bvh_bone *bones, int bone)
{
    int depth = 0;
    for (int at = bone; bones[at].parent != BVH_ROOT; at = bones[at].parent)
        depth++;
    return depth;
}

static void print_bone_head(const struct bvh_bone *bone, int indent, bool leaf, FILE *out)
{
    fprintf(out, "%*s%s %s\n%*s{\n", indent, "", bone->parent == BVH_ROOT ? "ROOT" : "JOINT", bone->name, indent, "");
    print_offset(indent + 2, bone->offset, out);
    fprintf(out, "%*sCHANNELS %s Zrotation Xrotation Yrotation\n", indent + 2, "",
            has_positions(bone) ? "6 Xposition Yposition Zposition" : "3");
    if (!leaf)
        return;
    fprintf(out, "%*sEnd Site\n%*s{\n", indent + 2, "", indent + 2, "");
    print_offset(indent + 4, bone->end, out);
    fprintf(out, "%*s}\n", indent + 2, "");
}

void bvh_print_hierarchy(const struct bvh_bone *bones, int count, FILE *out)
{
    fputs("HIERARCHY\n", out);
    for (int b = 0; b < count; b++) {
        const int depth = depth_of(bones, b), next = b + 1 < count ? depth_of(bones, b + 1) : 0;
        print_bone_head(&bones[b], 2 * depth, next <= depth, out);
        for (int open = depth; open >= next; open--)
            fprintf(out, "%*s}\n", 2 * open, "");
    }
}

void bvh_print_motion(int64_t frames, double frame_s, FILE *out)
{
    fprintf(out, "MOTION\nFrames: %lld\nFrame Time: %.6f\n", (long long)frames, frame_s);
}

void bvh_print_bone(const struct bvh_bone *bone, struct vec3 at, struct quat local, FILE *out)
{
    double m[3][3];
    quat_to_matrix(local, m);
    const double x = portable_asin(fmax(-1, fmin(1, m[2][1])));
    const bool locked = fabs(m[2][1]) > 1 - 1e-9;
    const double z = locked ? portable_atan2(m[1][0], m[0][0]) : portable_atan2(-m[0][1], m[1][1]),
                 y = locked ? 0 : portable_atan2(-m[2][0], m[2][2]);
    if (has_positions(bone))
        fprintf(out, "%s%.4f %.4f %.4f", bone->parent == BVH_ROOT ? "" : " ", CM * at.x, CM * at.y, CM * at.z);
    fprintf(out, " %.4f %.4f %.4f", z * DEG, x * DEG, y * DEG);
}
