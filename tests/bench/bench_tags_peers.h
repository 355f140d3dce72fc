// The usual alternatives for tags: libapriltag as it comes, and OpenCV's ArUco with the same family. Grey images, one
// tag of known number and side.
#pragma once
#include "recording/place.h"

#ifdef __cplusplus
extern "C" {
#endif

struct apriltag_peer; // libapriltag's detector and its own pose estimation
MUST_CHECK enum status apriltag_peer_open(struct apriltag_peer **out, double quad_decimate);
void apriltag_peer_close(struct apriltag_peer **p);
// NOTHING: not found.
enum status apriltag_peer_find(struct apriltag_peer *p, const uint8_t *gray, const struct lens *lens, int32_t id,
                               double side_m, struct pose *camera_from_tag);

// The camera's pose from the largest visible tag of a place. NOTHING: none of them is visible.
enum status apriltag_peer_locate(struct apriltag_peer *p, const uint8_t *gray, const struct lens *lens,
                                 const struct place_tag *tags, int32_t tag_count, struct pose *world_from_camera);

// All visible tags of a list: their indices in it and their poses.
struct apriltag_peer_tag {
    int32_t index;
    struct pose camera_from_tag;
};
struct apriltag_peer_tags {
    const struct place_tag *tags; // which there are, with their sides
    int32_t tag_count;
    struct apriltag_peer_tag *seen;
    int most;
};
// How many of them.
int apriltag_peer_find_all(struct apriltag_peer *p, const uint8_t *gray, const struct lens *lens,
                           const struct apriltag_peer_tags *of);

enum aruco_corners { ARUCO_NONE, ARUCO_SUBPIX, ARUCO_APRILTAG };
enum status aruco_peer_find(enum aruco_corners corners, const uint8_t *gray, const struct lens *lens, int32_t id,
                            double side_m, struct pose *camera_from_tag);

#ifdef __cplusplus
}
#endif
