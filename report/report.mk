# The report: how wrong the pictures are, and for how much time.  Included by the top Makefile.
#
#?pictures: report          the report of errors against run time: build/report/index.html, report.csv (REPORT_SECTIONS="time depth" for some)
#?pictures: report-clean    forget its results
#
# Every command runs once and keeps its result under build/report with what it cost and the builds of its programs: a run that was
# stopped goes on where it was, what another build of a program would make is made again.  Two at a time (REPORT_JOBS); REPORT_SIZE=WxH is the size of the sweeps' pictures.

REPORT          := $(B0)/report
REPORT_SECTIONS ?= figures time size storage budget depth grid lamps shrink
REPORT_FIGURES  ?= figure10 figure11 figure12
REPORT_JOBS     ?= $(shell nproc 2>/dev/null || echo 2)
REPORT_SIZE     ?= 64x48
REPORT_FROM     := $(or $(FIG),$(B0)/figures)
REPORT_READS    := $(if $(filter figures,$(REPORT_SECTIONS)),\
                     $(foreach f,$(REPORT_FIGURES),$(foreach p,photo with_room with_room.lamps with_single mask,$(REPORT_FROM)/$(f)/$(p).hdr)))
REPORT_SCENES   := $(wildcard scenes/demo/* scenes/figure12/* scenes/models/*.py) scenes/compare.py scenes/pictures.py scenes/rgbe.py $(TIMED) \
                     $(wildcard bench/lamps/*.py) $(if $(filter lamps shrink,$(REPORT_SECTIONS)),$(B)/test/caster.so)

.PHONY: report report-clean
report: $(REPORT)/index.html
	@echo "The report:   $(TOP)/$(REPORT)/index.html"; echo "Its numbers:  $(TOP)/$(REPORT)/report.csv"
$(eval $(call settings,$(REPORT)/settings,$(REPORT_SECTIONS); $(REPORT_FIGURES) of $(REPORT_FROM); $(REPORT_SIZE)))
$(REPORT)/index.html: $(REPORT)/settings $(wildcard report/*.py) $(REPORT_SCENES) $(REPORT_READS) \
		$(call made_by,oconv xform rpict rtrace pfilt pcomb obj2mesh virtualcamera hdrgen fishremap falloffcal ilfpack ilfinfo ilflamps) | $(VENV)/.ilf $(FUNCTIONS)
	@ILF_BUILD=$(B) REPORT_JOBS=$(REPORT_JOBS) REPORT_SIZE=$(REPORT_SIZE) REPORT_FIGURES="$(REPORT_FIGURES)" REPORT_FROM=$(REPORT_FROM) \
		$(PY) -m report all $(REPORT_SECTIONS)
report-clean:
	rm -rf $(REPORT)

#?pictures: report-check    run the report's shorter commands again and compare what they print with its table
.PHONY: report-check
report-check: $(REPORT)/index.html
	@ILF_BUILD=$(B) $(PY) -m report check
