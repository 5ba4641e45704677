# The documents as pages, and the tutorial's pictures.  Included by the top Makefile.
#
#?words: docs            pages to read: build/doc/html/index.html (these documents, the manual, libilf's API)
#?words: tutorial        run docs/TUTORIAL.md's commands and make its pictures again (docs/tutorial/)
#
# API pages come from the headers by doxygen.  Our comments are plain ones: doxygen.sed turns them into its own kind on the way.

DEBS_DOCS := doxygen mandoc
HTML      := $(B0)/doc/html
DOC_PAGES := README.md CONTRIBUTING.md CHANGELOG.md $(wildcard docs/*.md) scenes/README.md python/README.md
DOC_MAN   := $(patsubst man/%,$(HTML)/man/%.html,$(wildcard man/*.1 man/*.7))
DOC_HEADS := $(wildcard ilfmat/*.h ilfmat/*/*.h common/*/*.h tools/*/*.h)

.PHONY: docs docs-clean tutorial
docs: $(HTML)/index.html $(DOC_MAN) $(HTML)/api/index.html
	@echo "The pages: $(TOP)/$(HTML)/index.html"
docs-clean:
	rm -rf $(HTML)

$(B0)/.debs-docs: setup/debs.sh docs/docs.mk | $(B0)/.debs-radiance
	@sh setup/debs.sh $(DEBS_DOCS) && mkdir -p $(@D) && touch $@

$(HTML)/man/%.html: man/% docs/man.css | $(B0)/.debs-docs
	@mkdir -p $(@D) && cp docs/man.css $(@D)
	@mandoc -T html -O style=man.css,man=%N.%S.html,toc $< > $@.part && mv $@.part $@

$(HTML)/index.html: docs/render.py docs/page.css $(DOC_PAGES) $(wildcard docs/*.jpg docs/tutorial/*) | $(VENV)/.packages
	@mkdir -p $(@D)
	@$(PY) docs/render.py $(HTML) $(DOC_PAGES)

# a public function of libilf without a comment ends this
$(HTML)/api/index.html: docs/Doxyfile docs/doxygen.sed $(DOC_HEADS) | $(B0)/.debs-docs
	@mkdir -p $(@D)
	@{ cat docs/Doxyfile; echo 'PROJECT_NUMBER = $(VERSION)'; echo 'OUTPUT_DIRECTORY = $(HTML)'; \
	   echo 'WARN_LOGFILE = $(HTML)/api.warnings'; } | doxygen - > /dev/null
	@! grep '/ilfmat/ilf\.h:.*(function)' $(HTML)/api.warnings

tutorial: $(B0)/.debs-test all $(VENV)/.packages
	@$(PY) docs/tutorial.py --build $(B) --pictures docs/tutorial
