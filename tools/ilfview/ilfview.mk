# The page that ilfview fills in: page/page.html with the other files of page/ in the places that name them (@FILE@ alone on
# a line), as one C string.  Included by the top Makefile.
#
#?measures: test-view       the viewer's page in a real browser (installs chromium)

VIEW_PAGE := $(wildcard tools/ilfview/page/*)
$(B)/gen/ilfview_page.inc: $(VIEW_PAGE) tools/ilfview/ilfview.mk
	@mkdir -p $(@D)
	@awk '/^@[a-z]+\.[a-z]+@$$/ { f = "tools/ilfview/page/" substr($$0, 2, length($$0) - 2); while ((getline line < f) > 0) print line; next } { print }' \
	    tools/ilfview/page/page.html | sed -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/"/' -e 's/$$/\\n"/' >$@
$(B)/obj/tools/ilfview/page.o: override CPPFLAGS += -I$(B)/gen
$(B)/obj/tools/ilfview/page.o: $(B)/gen/ilfview_page.inc

# the page's own tests: ILF_BROWSER=FOLDER keeps pictures of it
DEBS_VIEW := chromium chromium-driver
$(B0)/.debs-view: setup/debs.sh tools/ilfview/ilfview.mk | $(B0)/.debs-tools
	@sh setup/debs.sh $(DEBS_VIEW) && touch $@
$(VENV)/.selenium: $(VENV)/.packages
	@$(PY) -m pip install -q --disable-pip-version-check 'selenium>=4.20' && touch $@
.PHONY: test-view
test-view: $(B0)/.debs-view $(VENV)/.selenium $(B)/bin/ilfview $(B)/bin/ilftrace
	ILF_BUILD=$(B) ILF_BROWSER=$(or $(ILF_BROWSER),1) $(PY) -m pytest -q -p no:cacheprovider tests/ilfview $(TEST_ARGS)
