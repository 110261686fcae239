// Reads a file of OTLP in JSON by OpenTelemetry's own parser, and prints a line of JSON for each span, after one for
// its resource: otlp FILE.
package main

import (
	"encoding/json"
	"fmt"
	"math"
	"os"
	"strings"

	"go.opentelemetry.io/collector/pdata/pcommon"
	"go.opentelemetry.io/collector/pdata/ptrace"
)

type event struct {
	Name       string         `json:"name"`
	Time       uint64         `json:"time"`
	Attributes map[string]any `json:"attributes"`
}

type link struct {
	Trace      string         `json:"traceId"`
	Span       string         `json:"spanId"`
	Attributes map[string]any `json:"attributes"`
}

type span struct {
	Name       string         `json:"name"`
	Trace      string         `json:"traceId"`
	Span       string         `json:"spanId"`
	Parent     string         `json:"parentSpanId"`
	Kind       string         `json:"kind"`
	Start      uint64         `json:"start"`
	End        uint64         `json:"end"`
	Status     int32          `json:"status"`
	Message    string         `json:"message"`
	Attributes map[string]any `json:"attributes"`
	Events     []event        `json:"events"`
	Links      []link         `json:"links"`
}

type resource struct {
	Resource map[string]any `json:"resource"`
	Scope    string         `json:"scope"`
}

// Attributes of which two have the same key are an error: a map would have one of them.
func attributes(m pcommon.Map) map[string]any {
	known := m.AsRaw()
	if len(known) != m.Len() {
		fail(fmt.Errorf("a key occurs more than once in %v", known))
	}
	for key, value := range known {
		// JSON has no such numbers: they are texts, as in a trace file.
		if number, ok := value.(float64); ok && (math.IsInf(number, 0) || math.IsNaN(number)) {
			known[key] = strings.TrimPrefix(strings.ToLower(fmt.Sprint(number)), "+")
		}
	}
	return known
}

func spanOf(s ptrace.Span) span {
	events, links := []event{}, []link{}
	for i := 0; i < s.Events().Len(); i++ {
		e := s.Events().At(i)
		events = append(events, event{e.Name(), uint64(e.Timestamp()), attributes(e.Attributes())})
	}
	for i := 0; i < s.Links().Len(); i++ {
		l := s.Links().At(i)
		links = append(links, link{l.TraceID().String(), l.SpanID().String(), attributes(l.Attributes())})
	}
	return span{
		Name: s.Name(), Trace: s.TraceID().String(), Span: s.SpanID().String(), Parent: s.ParentSpanID().String(),
		Kind: s.Kind().String(), Start: uint64(s.StartTimestamp()), End: uint64(s.EndTimestamp()),
		Status: int32(s.Status().Code()), Message: s.Status().Message(), Attributes: attributes(s.Attributes()),
		Events: events, Links: links,
	}
}

func fail(err error) {
	fmt.Fprintln(os.Stderr, err)
	os.Exit(1)
}

func main() {
	if len(os.Args) != 2 {
		fail(fmt.Errorf("usage: otlp FILE"))
	}
	content, err := os.ReadFile(os.Args[1])
	if err != nil {
		fail(err)
	}
	traces, err := (&ptrace.JSONUnmarshaler{}).UnmarshalTraces(content)
	if err != nil {
		fail(err)
	}
	out := json.NewEncoder(os.Stdout)
	for i := 0; i < traces.ResourceSpans().Len(); i++ {
		r := traces.ResourceSpans().At(i)
		for j := 0; j < r.ScopeSpans().Len(); j++ {
			scope := r.ScopeSpans().At(j)
			if err := out.Encode(resource{attributes(r.Resource().Attributes()), scope.Scope().Name()}); err != nil {
				fail(err)
			}
			for k := 0; k < scope.Spans().Len(); k++ {
				if err := out.Encode(spanOf(scope.Spans().At(k))); err != nil {
					fail(err)
				}
			}
		}
	}
}
