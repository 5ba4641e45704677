# What Radiance 5.4a's source distribution is made of.  Included by ../build.mk.
#
# RAD_COMMON, RAD_RT: the two libraries.  RAD_MAIN_X: what program X is of besides.  RAD_RENDERERS: programs of the first library that
# know light fields.  RAD_EXTRA: programs of the library package, which know no object types.  RAD_MORE: what radiance-all builds besides.

RAD_COMMON := addobjnotify badarg biggerlib bmalloc bmpfile bsdf bsdf_m bsdf_t byteswap caldefn calexpr \
	calfunc calprnt ccolor ccyrgb chanvalue clip color colrops cone cvtcmd depthcodec dircode disk2square \
	ealloc eputs erf error expandarg ezxml face falsecolor fdate fgetline fgetval fgetword fixargv0 \
	fltdepth font fputword free_os fropen fvect gethomedir getpath header hilbert idmap image \
	instance interp2d invmat4 jitteraperture lamps linregr loadbsdf loadvars lookup mat4 mesh modobject \
	multisamp myhostname normcodec objset octree otypes paths plocate portio process quit readfargs \
	readmesh readobj readoct resolu rexpr savestr savqstr sceneio spec_rgb strlcpy tcos timegm tmap16bit \
	tmapcolrs tmapluv tmaptiff tmesh tonemap triangulate unix_process urand urind wordfile words wputs \
	xf zeroes
# pmcontrib2 goes with rcontrib alone; pmapooc is included by another file
RAD_RT := ambcomp ambient ambio aniso ashikhmin data dielectric fprism freeobjmem func glass initotypes \
	m_alias m_brdf m_bsdf m_clip m_direct m_mirror m_mist mx_data mx_func noise3 normal o_cone o_face \
	o_instance o_mesh p_data p_func pmap pmapamb pmapbias pmapcontrib pmapdata pmapdiag pmapio pmapmat \
	pmapopt pmapparm pmaprand pmapray pmapsrc pmaptype pmutil preload raytrace renderopts source sphere \
	srcobstr srcsamp srcsupp t_data t_func text virtuals

RAD_MAIN_rpict     := rt/rpmain rt/rpict rt/srcdraw rt/persist rt/duphead
RAD_MAIN_rtrace    := rt/rtmain rt/rtrace rt/duphead rt/persist rt/raycalls rt/raypcalls rt/rayfifo
RAD_MAIN_rcontrib  := rt/rcmain rt/rcontrib rt/rc2 rt/rc3 rt/pmcontrib2
RAD_MAIN_lookamb   := rt/lookamb rt/ambio
RAD_MAIN_oconv     := ot/bbox ot/initotypes ot/o_cone ot/o_face ot/o_instance ot/oconv ot/sphere ot/writeoct
RAD_MAIN_xform     := gen/xform
RAD_MAIN_gendaylit := gen/gendaylit gen/sun
RAD_MAIN_pfilt     := px/pfilt px/pf2 px/pf3
RAD_MAIN_pcomb     := px/pcomb
RAD_MAIN_pcompos   := px/pcompos
RAD_MAIN_pvalue    := px/pvalue
RAD_MAIN_getinfo   := util/getinfo
RAD_MAIN_vwrays    := util/vwrays
RAD_MAIN_rcalc     := cal/rcalc
RAD_MAIN_cnt       := cal/cnt
RAD_MAIN_total     := cal/total
RAD_RENDERERS      := rpict rtrace rcontrib
RAD_OTHERS         := oconv xform getinfo pfilt pcomb pcompos pvalue vwrays rcalc cnt total gendaylit lookamb
RAD_PROGRAMS       := $(RAD_RENDERERS) $(RAD_OTHERS)
# programs of the library package that our rules may use and that know no object types
RAD_EXTRA := obj2mesh obj2rad genbox gensurf genrev genworm genprism gensky ies2rad replmarks \
	pcond pextrem pflip protate pinterp psign ra_xyze ra_ppm normtiff ev histo icalc rlam rcomb rmtxop

# radiance-all
RAD_MAIN_mkpmap    := rt/mkpmap
RAD_MAIN_pmapdump  := rt/pmapdump
RAD_MAIN_rvu       := rt/rvmain rt/rview rt/rv2 rt/rv3 rt/devtable rt/devcomm rt/editline rt/x11 rt/x11twind rt/colortab rt/raycalls \
	rt/raypcalls rt/rayfifo
RAD_LIBS_rvu       := -lX11
RAD_MORE_RENDERERS := mkpmap pmapdump
RAD_MORE_X11       := rvu
RAD_MORE           :=
RAD_SCRIPTS        :=
RAD_FILES          :=
