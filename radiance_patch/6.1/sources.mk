# What Radiance 6.1's source tree is made of.  Included by ../build.mk, which says what each list is.

RAD_COMMON := addobjnotify badarg biggerlib bmalloc bmpfile bsdf bsdf_m bsdf_t byteswap caldefn \
	calexpr calfunc calprnt ccolor ccyrgb chanvalue clip color colrops cone cvtcmd data depthcodec \
	dircode disk2square dmessage ealloc eputs erf error expandarg ezxml face falsecolor fdate fgetline \
	fgetval fgetword fixargv0 fltdepth font fputword free_os fropen fvect gethomedir getpath header \
	hilbert idmap image instance interp2d invmat4 jitteraperture lamps linregr loadbsdf loadvars lookup \
	mat4 mesh modobject multisamp myhostname normcodec objset octree otypes paths plocate portio \
	process quit readCSV readfargs readmesh readobj readoct resolu rexpr savestr savqstr sceneio \
	spec_rgb tcos timegm tmap16bit tmapcolrs tmapluv tmaptiff tmesh tonemap triangulate urand urind \
	wordfile words wputs xf zeroes unix_process strnstr strlcpy
# drawn in by those that ask for them
RAD_COMMON += abitmap abitmapio objutil readwfobj convertobj writewfobj objtriangulate mgf_context mgf_object mgf_parser mgf_xf \
	g3affine g3flist g3sphere g3vector gbasic muc_randvar
# pmcontrib2 goes with the old rcontrib alone; pmapooc is included by another file
RAD_RT := ambcomp ambient ambio aniso ashikhmin dielectric fprism freeobjmem func glass initotypes \
	m_alias m_brdf m_bsdf m_wgmdf m_clip m_direct m_mirror m_mist mx_data mx_func noise3 normal o_cone \
	o_face o_instance o_mesh p_data p_func pmap pmapamb pmapbias pmapcontrib pmapdata pmapdiag pmapio \
	pmapmat pmapopt pmapparm pmaprand pmapray pmapsrc pmaptype pmutil preload raytrace renderopts \
	source sphere srcobstr srcsamp srcsupp t_data t_func text virtuals

# what the simulation managers stand on
RAD_CALLS := rt/raycalls rt/raypcalls rt/rayfifo
RAD_MTX   := util/cmatrix util/cmbsdf util/cmconst
RAD_RBF   := cv/bsdfrep cv/bsdfinterp

RAD_MAIN_rpict     := rt/rpmain rt/rpict rt/srcdraw rt/persist rt/duphead
RAD_MAIN_rtrace    := rt/rtmain rt/rtrace rt/duphead rt/persist $(RAD_CALLS)
RAD_MAIN_rcontrib  := rt/rcmain rt/rcontrib rt/rc2 rt/rc3 rt/pmcontrib2
RAD_MAIN_rxtrace   := rt/rxtmain rt/rxtrace rt/RtraceSimulManager $(RAD_CALLS)
RAD_MAIN_rxpict    := rt/rxpmain rt/RpictSimulManager rt/RtraceSimulManager rt/srcdraw $(RAD_CALLS)
RAD_MAIN_rxpiece   := rt/rxpiece rt/RpictSimulManager rt/RtraceSimulManager rt/srcdraw $(RAD_CALLS)
RAD_MAIN_rxcontrib := rt/rxcmain rt/RcontribSimulManager rt/RtraceSimulManager rt/RdataShareFile rt/RdataShareMap $(RAD_CALLS)
RAD_MAIN_rxfluxmtx := rt/rxfluxmtx rt/RcontribSimulManager rt/RtraceSimulManager rt/RdataShareFile rt/RdataShareMap $(RAD_CALLS)
RAD_MAIN_lookamb   := rt/lookamb rt/ambio
RAD_MAIN_oconv     := ot/bbox ot/initotypes ot/o_cone ot/o_face ot/o_instance ot/oconv ot/sphere ot/writeoct
RAD_MAIN_obj2mesh  := ot/cvmesh ot/o_face ot/obj2mesh ot/wfconv ot/writemesh
RAD_MAIN_xform     := gen/xform
RAD_MAIN_gendaylit := gen/gendaylit gen/sun
RAD_MAIN_gensky    := gen/gensky gen/sun
RAD_MAIN_genbox    := gen/genbox
RAD_MAIN_gensurf   := gen/gensurf
RAD_MAIN_genrev    := gen/genrev
RAD_MAIN_genworm   := gen/genworm
RAD_MAIN_genprism  := gen/genprism
RAD_MAIN_replmarks := gen/replmarks
RAD_MAIN_obj2rad   := cv/obj2rad cv/trans
RAD_MAIN_ies2rad   := cv/ies2rad
RAD_MAIN_pfilt     := px/pfilt px/pf2 px/pf3
RAD_MAIN_pcomb     := px/pcomb
RAD_MAIN_pcompos   := px/pcompos
RAD_MAIN_pvalue    := px/pvalue
RAD_MAIN_pcond     := px/pcond px/pcond2 px/pcond3 px/pcond4 px/warp3d
RAD_MAIN_pextrem   := px/pextrem
RAD_MAIN_pflip     := px/pflip
RAD_MAIN_protate   := px/protate
RAD_MAIN_pinterp   := px/pinterp
RAD_MAIN_psign     := px/psign
RAD_MAIN_ra_xyze   := px/ra_xyze
RAD_MAIN_ra_ppm    := px/ra_ppm
RAD_MAIN_getinfo   := util/getinfo
RAD_MAIN_vwrays    := util/vwrays
RAD_MAIN_rcomb     := util/rcomb util/cmconst util/rmatrix
RAD_MAIN_rmtxop    := util/rmtxop util/rmatrix util/rmconvert $(RAD_MTX)
RAD_MAIN_rcalc     := cal/rcalc
RAD_MAIN_cnt       := cal/cnt
RAD_MAIN_total     := cal/total
RAD_MAIN_ev        := cal/ev
RAD_MAIN_histo     := cal/histo
RAD_MAIN_icalc     := cal/calc
RAD_MAIN_rlam      := cal/lam

RAD_CXX            := rxtrace rxpict rxpiece rxcontrib rxfluxmtx
RAD_RENDERERS      := rpict rtrace rcontrib rxpiece rxfluxmtx
RAD_OTHERS         := oconv xform getinfo pfilt pcomb pcompos pvalue vwrays rcalc cnt total gendaylit lookamb obj2mesh obj2rad genbox \
	gensurf genrev genworm genprism gensky ies2rad replmarks pcond pextrem pflip protate pinterp psign ra_xyze ra_ppm ev \
	histo icalc rlam rcomb rmtxop
RAD_EXTRA          :=

# radiance-all
RAD_MAIN_mkpmap    := rt/mkpmap
RAD_MAIN_pmapdump  := rt/pmapdump
RAD_MAIN_mkillum   := gen/mkillum gen/mkillum2 gen/mkillum3 $(RAD_CALLS)
RAD_MAIN_mksource  := gen/mksource $(RAD_CALLS)
RAD_MAIN_ranimove  := util/ranimove util/ranimove1 util/ranimove2 $(RAD_CALLS)
RAD_MAIN_rsensor   := util/rsensor $(RAD_CALLS)
RAD_MAIN_rvu       := rt/rvmain rt/rview rt/rv2 rt/rv3 rt/devtable rt/devcomm rt/editline rt/x11 rt/x11twind rt/colortab $(RAD_CALLS)
RAD_LIBS_rvu       := -lX11
RAD_MAIN_ximage    := px/x11image px/x11raster px/clrtab
RAD_LIBS_ximage    := -lX11
RAD_MAIN_xshowtrace := px/xshowtrace common/x11findwind
RAD_LIBS_xshowtrace := -lX11
RAD_MAIN_xglaresrc := util/xglaresrc common/x11findwind
RAD_LIBS_xglaresrc := -lX11
RAD_MAIN_rad       := util/rad
RAD_MAIN_rpiece    := util/rpiece rt/Version
RAD_MAIN_ranimate  := util/ranimate util/netproc
RAD_MAIN_rfluxmtx  := util/rfluxmtx
RAD_MAIN_vwright   := util/vwright
RAD_MAIN_rcrop     := util/rcrop
RAD_MAIN_rcollate  := util/rcollate
RAD_MAIN_rttree_reduce := util/rttree_reduce
RAD_MAIN_radcompare := util/radcompare
RAD_MAIN_rcode_depth := util/rcode_depth
RAD_MAIN_rcode_norm := util/rcode_norm
RAD_MAIN_rcode_ident := util/rcode_ident
RAD_MAIN_pvsum     := util/pvsum util/cmconst util/rmatrix
RAD_MAIN_wrapBSDF  := util/wrapBSDF
RAD_MAIN_eplus_adduvf := util/eplus_adduvf util/eplus_idf
RAD_MAIN_evalglare := util/evalglare util/pictool
RAD_MAIN_findglare := util/findglare util/glareval util/glaresrc util/setscan
RAD_MAIN_glarendx  := util/glarendx
RAD_MAIN_dcglare   := util/dcglare util/cmglare $(RAD_MTX)
RAD_MAIN_dctimestep := util/dctimestep util/threadpool util/tinycthread util/cmmap util/cmatrixalign util/mmavx2 $(RAD_MTX)
# it asks the processor before it calls what is in there
ifeq ($(shell uname -m),x86_64)
$(B)/radiance/obj/util/mmavx2.o: RAD_CFLAGS += -mavx2 -mfma
endif
RAD_MAIN_getbbox   := ot/bbox ot/getbbox ot/init2otypes ot/readobj2
RAD_MAIN_genssky   := gen/genssky gen/sun gen/atmos
RAD_MAIN_gensdaymtx := gen/gensdaymtx gen/sun gen/atmos gen/loadEPW
RAD_MAIN_gendaymtx := gen/gendaymtx gen/sun gen/loadEPW
RAD_MAIN_genglaze  := gen/genglaze
RAD_MAIN_genblinds := gen/genblinds
RAD_MAIN_genclock  := gen/genclock
RAD_MAIN_neaten    := cal/neat
RAD_MAIN_rsplit    := cal/rsplit
RAD_MAIN_tabfunc   := cal/tabfunc
RAD_MAIN_pcwarp    := px/pcwarp px/warp3d
RAD_MAIN_macbethcal := px/macbethcal px/pmapgen px/mx3 px/warp3d
RAD_MAIN_pmblur2   := px/pmblur2
RAD_MAIN_psketch   := px/psketch
RAD_MAIN_ttyimage  := px/ttyimage
RAD_MAIN_ra_bmp    := px/ra_bmp
RAD_MAIN_ra_gif    := px/ra_gif px/clrtab px/neuclrtab
RAD_MAIN_ra_hexbit := px/ra_hexbit
RAD_MAIN_ra_pict   := px/ra_pict
RAD_MAIN_ra_ps     := px/ra_ps
RAD_MAIN_ra_rgbe   := px/ra_rgbe
RAD_MAIN_ra_t16    := px/ra_t16
RAD_MAIN_ra_t8     := px/ra_t8 px/clrtab px/neuclrtab
RAD_MAIN_ra_tiff   := px/ra_tiff
RAD_LIBS_ra_tiff   := -ltiff
RAD_MAIN_arch2rad  := cv/arch2rad cv/trans
RAD_MAIN_nff2rad   := cv/nff2rad
RAD_MAIN_lampcolor := cv/lampcolor
RAD_MAIN_tmesh2rad := cv/tmesh2rad
RAD_MAIN_robjutil  := cv/robjutil
RAD_MAIN_mgf2rad   := cv/mgf2rad
RAD_MAIN_rad2mgf   := cv/rad2mgf
RAD_MAIN_mgfilt    := cv/mgfilt
RAD_MAIN_mgf2inv   := cv/mgf2inv
RAD_MAIN_bsdf2rad  := cv/bsdf2rad $(RAD_RBF)
RAD_MAIN_bsdf2ttree := cv/bsdf2ttree $(RAD_RBF)
RAD_MAIN_bsdf2klems := cv/bsdf2klems $(RAD_RBF)
RAD_MAIN_bsdfquery := cv/bsdfquery $(RAD_RBF)
RAD_MAIN_bsdfpeaks := cv/bsdfpeaks $(RAD_RBF)
RAD_MAIN_pkgBSDF   := cv/pkgBSDF cv/trans
RAD_MAIN_checkBSDF := cv/checkBSDF
RAD_MAIN_epw2wea   := cv/epw2wea

RAD_MORE_RENDERERS := mkillum mksource ranimove rsensor mkpmap pmapdump rxtrace rxpict rxcontrib
RAD_MORE_X11       := rvu ximage xshowtrace xglaresrc
RAD_MORE           := rad rpiece ranimate rfluxmtx vwright rcrop rcollate rttree_reduce radcompare rcode_depth rcode_norm rcode_ident \
	pvsum wrapBSDF eplus_adduvf evalglare findglare glarendx dcglare dctimestep getbbox genssky gensdaymtx gendaymtx genglaze \
	genblinds genclock neaten rsplit tabfunc pcwarp macbethcal pmblur2 psketch ttyimage ra_bmp ra_gif ra_hexbit ra_pict ra_ps ra_rgbe \
	ra_t16 ra_t8 ra_tiff arch2rad nff2rad lampcolor tmesh2rad robjutil mgf2rad rad2mgf mgfilt mgf2inv bsdf2rad bsdf2ttree bsdf2klems \
	bsdfquery bsdfpeaks pkgBSDF checkBSDF epw2wea
RAD_SCRIPTS        := util/genBSDF.pl util/bsdfview.pl util/genambpos.pl util/genklemsamp.pl util/genskyvec.pl util/ltpict.pl \
	util/ltview.pl util/objpict.pl util/objview.pl util/rcode2bmp.pl util/rtpict.pl util/compamb.csh util/dayfact.csh util/fieldcomb.csh \
	util/glare.csh util/objline.csh util/raddepend.csh util/rlux.csh util/vinfo.csh px/falsecolor.pl px/phisto.pl px/normpat.csh \
	px/pdfblur.csh px/pgblur.csh px/pmblur.csh px/pmdblur.csh px/ra_pfm.csh px/xyzimage.csh gen/glaze.csh cv/optics2rad.pl \
	cv/iso2klems.pl
# function files and tables that lie beside the sources; cal/cal/ holds nothing else
RAD_FILES          := rt/rayinit.cal common/tmesh.cal cal/cal/* gen/*.cal gen/clockface.hex gen/mie_ca.dat util/*.cal \
	util/minimalBSDFt.xml util/tregsamp.dat util/WINDOW6BSDFt.xml cv/*.cal cv/lamp.tab
