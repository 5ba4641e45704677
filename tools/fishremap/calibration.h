/*
 * calibration.h - camera calibrations as other programs write them, as lenses.
 *
 *   OpenCV     cv::FileStorage (YAML, JSON, XML), or ROS camera_info: camera matrix and distortion
 *              coefficients; cv::fisheye (k1..k4) or the pinhole model with k1, k2, k3 .. k6
 *   gyroflow   lens profiles (JSON): cv::fisheye with its picture's size
 *   Kalibr     camchain (YAML): pinhole-equi, pinhole-radtan, pinhole-fov, omni (Mei), eucm, ds
 *   OCamCalib  calib_results.txt (Scaramuzza): z = f(rho), centre, affine c, d, e
 *
 * All but OCamCalib's have pixel (0,0) in the middle of the first pixel, x to the right, y down; x right, y
 * down, z ahead.  OCamCalib's x is the row and y the column, from 0 in the middle of the first pixel, and z
 * points back.
 */
#ifndef CALIBRATION_H
#define CALIBRATION_H

#include "base/errmsg.h"
#include "lens.h"

/* Is this text of one of these kinds? */
int calibration_is_ocam(const char *text);
int calibration_is_tree(const char *text);

/* Set the model, camera, shape and size of an unfinished lens.  camera: name of one of several, or NULL;
 * which: 1 or 2, where there are two and no name is given, else 0.  said: what had to be assumed, or "".
 * Anything that is not understood is refused by name. */
int calibration_ocam(lens *l, const char *text, const char *name, errmsg *e);
int calibration_tree(lens *l, char said[256], const char *text, const char *name, const char *camera,
                     int which, errmsg *e);

#endif
