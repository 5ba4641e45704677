# Debian packages, and their trial in a clean root.  Included by the top Makefile.
#
#?build: deb             Debian packages, in build/deb/
#?measures: test-deb        make deb's packages: looked at by lintian, installed in a clean system, used, purged (root, debootstrap; six minutes)

DEB := $(B0)/deb
.PHONY: deb test-deb
$(B0)/.debs-deb: setup/debs.sh setup/deb.mk
	@sh setup/debs.sh dpkg-dev file xz-utils && mkdir -p $(@D) && touch $@
# names that clash with others' lie in a folder of their own, or have a prefix
deb: all $(B0)/.debs-deb
	@rm -rf $(DEB)/staged $(DEB)/*.deb && mkdir -p $(DEB)
	@APART=1 PREFIXED=hdrgen $(MAKE) -s --no-print-directory install DESTDIR=$(TOP)/$(DEB)/staged PREFIX=/usr PROGRAM_PREFIX=ilf- >/dev/null
	@sh setup/deb.sh $(DEB)/staged "$(VERSION)" "$(ILF_ABI)" $(TOP)/$(DEB) && rm -rf $(DEB)/staged
test-deb: deb
	@sh setup/test-deb.sh $(TOP)/$(DEB)
