/*
 * spherepose.h - where the camera stands over a mirror-sphere array.  Pure.
 */
#ifndef SPHEREPOSE_H
#define SPHEREPOSE_H

#include "base/errmsg.h"
#include "sphere.h"

typedef struct sphere_pose {
    double camera[3]; /* position in the plane frame, unit: the pitch, origin: node (0,0) */
    double right[3];  /* the camera's picture axis to the right, plane frame */
    double tilt;      /* angle between the camera's axis and -n, radians */
} sphere_pose;

/* From the grid's homography and the camera's distance to the middle of the array in pitches.  The
 * camera's axis is taken to meet the picture at (cx, cy).  Grid steps are taken to be equal along u and v.
 * Fails where no camera at that distance sees the grid so. */
int sphere_pose_find(sphere_pose *p, const sphere_grid *g, double distance, double cx, double cy, errmsg *e);

/* Frame (rows right, up, axis) of the sphere at node (s, t): its axis points at the camera. */
void sphere_pose_frame(double frame[3][3], const sphere_pose *p, double s, double t);

#endif
