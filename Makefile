.PHONY: help demo test programs skeleton warnings doctest readme lint docs check matrix bench bench-check soak rules \
  signals reality attacks robot robots fleet fleets browser mutants mutants-fit release ci clean

help:
	@echo 'make demo      a robot recharges, finds the front door locked and takes the back door'
	@echo '               (ROBOT=patrol, pick-and-place, drone or fleet runs another robot)'
	@echo 'make test      the test suite, under three runtimes (ARGS="-m NAME" selects tests)'
	@echo 'make programs  run the example programs and check how each run ends'
	@echo 'make skeleton  run and test a copy of docs/your-own-robot, outside of this checkout'
	@echo 'make warnings  build everything with warnings as errors'
	@echo 'make doctest   run the examples in the documentation'
	@echo 'make readme    run the program in README.md'
	@echo 'make lint      hlint, format, phrases, links, and whether mutants and pages fit the sources'
	@echo 'make mutants-fit  whether the mutants fit the tests; one of each test program is tried'
	@echo 'make docs      build the documentation, which must cover every export'
	@echo 'make check     check the package with cabal check'
	@echo 'make matrix    demo and test in clean Debian systems (SUITES="bookworm" selects one)'
	@echo 'make ci        all of these, and make robots, browser and fleets'
	@echo 'make bench     what it costs, and whether the targets are met (KEEP=1 keeps the ratios;'
	@echo '               make bench-check compares with those that are kept)'
	@echo 'make soak      more random schedules and programs (SECONDS=600 for ten minutes)'
	@echo 'make signals   SIGINT, SIGTERM, SIGHUP at 1,000 random moments each (MOMENTS=100 for fewer)'
	@echo 'make reality   the simulator against real threads (SEED=7 selects the programs)'
	@echo 'make attacks   programs that try to break the promises (NAMES="Storm" selects)'
	@echo 'make robot     the mission of make demo on a simulated robot that speaks ROS, over a bridge'
	@echo 'make robots    goals, topics and lost links with real action servers over a real bridge (ROWS="2 3"'
	@echo '               selects; LONG=1: more often)'
	@echo 'make fleet     20 robots in processes of their own carry 500 orders, and are killed; all that they share is in'
	@echo '               a PostgreSQL that it starts'
	@echo 'make fleets    robots, connections and databases that are killed, frozen and cut off (ROWS="1 2" selects;'
	@echo '               LONG=1: more often)'
	@echo 'make browser   the live page in Chromium (ROWS="2 3" selects)'
	@echo 'make rules     the rules of the specification that no random program reaches'
	@echo 'make mutants   small mistakes in the sources, which the tests must detect (NAMES="debounce" selects)'
	@echo 'make release   the archives of a release, tried in a clean folder (uploads nothing)'
	@echo 'make clean     remove what was built'

demo:
ifdef ROBOT
	@.ci/exec robots '$(ROBOT)'
else
	@.ci/exec door-battery --front locked --back locked --battery 15 --drain 2 \
	  --charge 40 --threshold 10 --action 1 --speed 3
endif

test:
	@.ci/test $(ARGS)

programs skeleton warnings doctest readme lint docs check release:
	@.ci/$@

matrix:
	@.ci/matrix $(SUITES)

bench:
	@.ci/bench $(if $(KEEP),keep)

bench-check:
	@.ci/bench check

rules:
	@.ci/rules

soak:
	@.ci/soak $(or $(SECONDS),300)

signals:
	@.ci/signals $(or $(MOMENTS),1000)

reality:
	@.ci/reality $(SEED)

attacks:
	@.ci/attacks $(NAMES)

robot:
	@.ci/robots mission

robots:
	@.ci/robots $(ROWS)

fleet:
	@.ci/fleets mission

fleets:
	@.ci/fleets $(ROWS)

browser:
	@.ci/browser $(ROWS)

mutants:
	@.ci/mutants $(NAMES)

mutants-fit:
	@.ci/mutants --fit

ci:
	@.ci/run

clean:
	rm -rf dist-newstyle .stack-work
