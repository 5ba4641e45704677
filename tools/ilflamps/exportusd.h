/*
 * exportusd.h - lamps and what is left for programs that read USD.
 */
#ifndef EXPORTUSD_H
#define EXPORTUSD_H

#include "lookround.h"

/* Write NAME.usda: lamps as SphereLight, RectLight, DiskLight, CylinderLight, DistantLight; what is left as a DomeLight
 * whose picture NAME.dome.exr is what v->at sees; the surroundings as a mesh, where they are known.  Radiances are the
 * scene's: intensity x color = R G B, exposure 0, normalize false.  Masks are left out, with a remark. */
int exportusd_write(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e);

#endif
