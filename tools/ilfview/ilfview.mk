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
