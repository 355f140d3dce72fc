#include "tests/bench/bench_objects_peers.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace
{

cv::Mat as_mat(const struct gray_picture *p)
{
    return cv::Mat(p->height, p->width, CV_8UC1, const_cast<uint8_t *>(p->gray));
}

enum status find_orb(const struct gray_picture *picture, const struct gray_picture *image, int least,
                     struct pixel *middle)
{
    auto orb = cv::ORB::create(1500);
    std::vector<cv::KeyPoint> a, b;
    cv::Mat da, db;
    orb->detectAndCompute(as_mat(picture), cv::noArray(), a, da);
    orb->detectAndCompute(as_mat(image), cv::noArray(), b, db);
    if (da.empty() || db.rows < 2)
        return NOTHING;
    std::vector<std::vector<cv::DMatch>> matches;
    cv::BFMatcher(cv::NORM_HAMMING).knnMatch(da, db, matches, 2);
    std::vector<cv::Point2f> from, to;
    for (const auto &m : matches)
        if (m.size() == 2 && m[0].distance < 0.8f * m[1].distance) {
            from.push_back(a[(size_t)m[0].queryIdx].pt);
            to.push_back(b[(size_t)m[0].trainIdx].pt);
        }
    if (from.size() < 4)
        return NOTHING;
    cv::Mat inliers;
    const cv::Mat h = cv::findHomography(from, to, cv::RANSAC, 4, inliers);
    if (h.empty() || cv::countNonZero(inliers) < least)
        return NOTHING;
    const std::vector<cv::Point2f> centre = {{((float)picture->width - 1) / 2, ((float)picture->height - 1) / 2}};
    std::vector<cv::Point2f> at;
    cv::perspectiveTransform(centre, at, h);
    *middle = {at[0].x, at[0].y};
    return OK;
}

enum status find_template(const struct gray_picture *picture, const struct gray_picture *image,
                          const struct plain_options *o, struct pixel *middle, double *score)
{
    cv::Mat small, turned, result;
    cv::resize(as_mat(image), small, cv::Size(), 0.25, 0.25, cv::INTER_AREA);
    const cv::Mat whole = as_mat(picture);
    *score = -1;
    for (double scale = o->least_scale; scale <= o->most_scale; scale *= o->scale_step)
        for (double angle = 0; angle < 6.2831; angle += o->angle_step) {
            // the picture's middle half, so that a turned window holds nothing else
            const int side = (int)(0.25 * scale * 0.7 * std::min(whole.cols, whole.rows));
            if (side < 6 || side > small.cols || side > small.rows)
                continue;
            cv::Mat map = cv::getRotationMatrix2D({(float)whole.cols / 2, (float)whole.rows / 2}, -angle * 57.29578,
                                                  0.25 * scale);
            map.at<double>(0, 2) += side / 2.0 - whole.cols / 2.0;
            map.at<double>(1, 2) += side / 2.0 - whole.rows / 2.0;
            cv::warpAffine(whole, turned, map, {side, side}, cv::INTER_AREA);
            cv::matchTemplate(small, turned, result, cv::TM_CCOEFF_NORMED);
            double best;
            cv::Point at;
            cv::minMaxLoc(result, nullptr, &best, nullptr, &at);
            if (best > *score && best <= 1) {
                *score = best;
                *middle = {4 * (at.x + side / 2.0), 4 * (at.y + side / 2.0)};
            }
        }
    return OK;
}

} // namespace

enum status orb_peer_find(const struct gray_picture *picture, const struct gray_picture *image, int least,
                          struct pixel *middle)
{
    cv::setNumThreads(1);
    try {
        return find_orb(picture, image, least, middle);
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "OpenCV: %s", e.what());
    }
}

enum status template_peer_find(const struct gray_picture *picture, const struct gray_picture *image,
                               const struct plain_options *options, struct pixel *middle, double *score)
{
    cv::setNumThreads(1);
    try {
        return find_template(picture, image, options, middle, score);
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "OpenCV: %s", e.what());
    }
}
