#include "tests/bench/bench_tags_peers.h"

#include <apriltag/apriltag_pose.h>
#include <apriltag/tag36h11.h>
#include <stdlib.h>

struct apriltag_peer {
    apriltag_detector_t *detector;
    apriltag_family_t *family;
};

enum status apriltag_peer_open(struct apriltag_peer **out, double quad_decimate)
{
    struct apriltag_peer *p = calloc(1, sizeof *p);
    *out = p;
    if (!p)
        return fail(ERR_MEMORY, "no memory for libapriltag");
    p->family = tag36h11_create();
    p->detector = apriltag_detector_create();
    apriltag_detector_add_family(p->detector, p->family);
    p->detector->quad_decimate = (float)quad_decimate;
    return OK;
}

void apriltag_peer_close(struct apriltag_peer **p)
{
    if (*p) {
        apriltag_detector_destroy((*p)->detector);
        tag36h11_destroy((*p)->family);
    }
    free(*p);
    *p = NULL;
}

static struct pose pose_of(apriltag_detection_t *detection, const struct lens *lens, double side_m)
{
    // Its (0, 0) is the corner of the first pixel.
    apriltag_detection_info_t info = {detection, side_m, lens->fx, lens->fy, lens->cx + 0.5, lens->cy + 0.5};
    apriltag_pose_t found;
    estimate_tag_pose(&info, &found);
    double m[3][3];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) // its tag has y down and z into the wall
            m[r][c] = MATD_EL(found.R, (unsigned)r, (unsigned)c) * (c ? -1 : 1);
    struct pose pose = {quat_from_matrix(m), {MATD_EL(found.t, 0, 0), MATD_EL(found.t, 1, 0), MATD_EL(found.t, 2, 0)}};
    free(found.R); // all that matd_destroy does, which Debian keeps in another library
    free(found.t);
    return pose;
}

enum status apriltag_peer_find(struct apriltag_peer *p, const uint8_t *gray, const struct lens *lens, int32_t id,
                               double side_m, struct pose *camera_from_tag)
{
    image_u8_t image = {
        .width = lens->width, .height = lens->height, .stride = lens->width, .buf = (uint8_t *)(uintptr_t)gray};
    zarray_t *found = apriltag_detector_detect(p->detector, &image);
    enum status status = NOTHING;
    for (int i = 0; i < zarray_size(found); i++) {
        apriltag_detection_t *detection;
        zarray_get(found, i, &detection);
        if (detection->id != id || status == OK)
            continue;
        *camera_from_tag = pose_of(detection, lens, side_m);
        status = OK;
    }
    apriltag_detections_destroy(found);
    return status;
}

static double area_of(const apriltag_detection_t *d)
{
    double sum = 0;
    for (int k = 0; k < 4; k++)
        sum += d->p[k][0] * d->p[(k + 1) % 4][1] - d->p[(k + 1) % 4][0] * d->p[k][1];
    return fabs(sum) / 2;
}

enum status apriltag_peer_locate(struct apriltag_peer *p, const uint8_t *gray, const struct lens *lens,
                                 const struct place_tag *tags, int32_t tag_count, struct pose *world_from_camera)
{
    image_u8_t image = {
        .width = lens->width, .height = lens->height, .stride = lens->width, .buf = (uint8_t *)(uintptr_t)gray};
    zarray_t *found = apriltag_detector_detect(p->detector, &image);
    apriltag_detection_t *largest = NULL;
    const struct place_tag *tag = NULL;
    for (int i = 0; i < zarray_size(found); i++) {
        apriltag_detection_t *detection;
        zarray_get(found, i, &detection);
        for (int32_t k = 0; k < tag_count; k++) {
            if (tags[k].id == detection->id && (!largest || area_of(detection) > area_of(largest))) {
                largest = detection;
                tag = &tags[k];
            }
        }
    }
    if (largest)
        *world_from_camera = pose_multiply(tag->world_from_tag, pose_inverse(pose_of(largest, lens, tag->side_m)));
    apriltag_detections_destroy(found);
    return largest ? OK : NOTHING;
}

int apriltag_peer_find_all(struct apriltag_peer *p, const uint8_t *gray, const struct lens *lens,
                           const struct apriltag_peer_tags *of)
{
    image_u8_t image = {
        .width = lens->width, .height = lens->height, .stride = lens->width, .buf = (uint8_t *)(uintptr_t)gray};
    zarray_t *found = apriltag_detector_detect(p->detector, &image);
    int count = 0;
    for (int i = 0; i < zarray_size(found); i++) {
        apriltag_detection_t *detection;
        zarray_get(found, i, &detection);
        for (int32_t k = 0; k < of->tag_count && count < of->most; k++)
            if (of->tags[k].id == detection->id)
                of->seen[count++] = (struct apriltag_peer_tag){k, pose_of(detection, lens, of->tags[k].side_m)};
    }
    apriltag_detections_destroy(found);
    return count;
}
